"""The hand that feels: a human arm and a haptic device against tissue, and for which tissues that is stable."""
