"""Tissue that was pushed into: how stiff it is, and how stiff it may be for a hand that feels it."""
