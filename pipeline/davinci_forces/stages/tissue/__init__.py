"""Estimate the stiffness of tissue, and the stiffness above which haptic feedback is unstable."""
