"""Trajectories that excite the parameters of a joint or an arm most, within its limits."""
