"""Trajectories that tell most about a joint or an arm, within its limits."""
