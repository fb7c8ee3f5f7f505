"""Explain why innovations are not white: remove each possible cause, and run the filter again without it."""
