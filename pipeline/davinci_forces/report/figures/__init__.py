"""Draw figures from data as SVG: panels, marks, ticks and colours."""
