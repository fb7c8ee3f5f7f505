"""Parameters from data: least squares, how far to trust them, and the search of a swarm."""
