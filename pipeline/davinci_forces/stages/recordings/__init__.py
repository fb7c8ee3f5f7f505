"""Compute the motion of every joint from the logs: read, resample, average and differentiate."""
