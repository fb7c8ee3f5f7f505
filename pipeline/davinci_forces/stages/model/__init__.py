"""Identify the model of every joint and of the whole arm, and score how well it predicts the effort."""
