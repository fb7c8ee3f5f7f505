"""Simulated studies: a scenario in, logs as the laboratory would have recorded them out, with the truth beside them."""
