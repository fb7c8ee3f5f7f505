"""Scenarios of simulated studies: their data, and the reading of their TOML."""
