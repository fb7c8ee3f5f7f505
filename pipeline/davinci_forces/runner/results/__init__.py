"""Results of finished studies: as data frames, and the results of many studies on one page."""
