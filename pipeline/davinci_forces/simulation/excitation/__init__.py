"""Excitation experiments as a command line asks for them: trajectories, tables and plots."""
