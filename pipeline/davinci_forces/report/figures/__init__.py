"""Draw figures from data with matplotlib: panels, marks, ticks and colours."""
