"""Figures as data become drawings: panels, marks, ticks and colours, by matplotlib."""
