"""What the readers cost, as ratios to doing as little as possible, within one run."""
