"""What a laboratory should run: excitation asked for in words, as trajectories, tables and plots."""
