"""Choosing a model: least squares with parts of the path left out, and which of the candidates to trust."""
