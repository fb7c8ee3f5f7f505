"""Motion that repeats: its period, its average, its harmonics."""
