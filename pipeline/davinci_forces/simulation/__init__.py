"""Simulated studies: from a scenario, logs as sensors would record them, and the ground truth."""
