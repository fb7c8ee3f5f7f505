"""Signals in time: clocks, periods, averages, harmonics, low-passing."""
