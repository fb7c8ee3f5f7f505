"""Processes that run tasks, on this machine or a cluster, with the same floating-point arithmetic."""
