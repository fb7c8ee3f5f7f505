"""Haptic feedback: a hand against tissue, simulated with device, link, arm and filter."""
