"""Excitation trajectories for the command line, with their tables and plots."""
