"""Simulated studies: a scenario in, logs as the sensors would have recorded them out, with the ground truth."""
