"""Stability of a human arm with a haptic device against tissue, and its simulation."""
