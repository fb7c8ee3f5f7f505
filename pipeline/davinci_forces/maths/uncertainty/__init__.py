"""How far estimates may be off: bands, levels, offsets, resampling."""
