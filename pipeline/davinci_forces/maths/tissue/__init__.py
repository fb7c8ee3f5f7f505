"""Stiffness, damping and contact of tissue from pushes into it."""
