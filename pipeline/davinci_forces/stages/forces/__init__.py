"""External effort on every joint, with its error: the filter, what it rests on, and what it shows of contacts."""
