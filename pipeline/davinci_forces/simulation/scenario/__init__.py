"""What is simulated and recorded: a scenario as data, and the reading of its TOML."""
