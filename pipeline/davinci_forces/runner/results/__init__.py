"""What a finished study states: its numbers as data frames, and those of many studies beside each other."""
