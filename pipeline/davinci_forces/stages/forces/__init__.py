"""Estimate the external effort on every joint, with its error, and measure every contact."""
