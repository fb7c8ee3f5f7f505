"""Uncertainty of estimates: error bands, free-space levels, day offsets, resampling."""
