"""Kinematics and rigid-body dynamics of the arm."""
