"""Excitation experiments for a command line: trajectories, tables and plots."""
