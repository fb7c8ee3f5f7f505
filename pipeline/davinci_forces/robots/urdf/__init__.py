"""Robots as URDF, the description that simulators and ROS share: read from it, and written as it."""
