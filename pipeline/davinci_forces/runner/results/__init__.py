"""Results of finished studies: as data frames, and those of many studies on one page."""
