"""What pushes into tissue tell of it."""
