"""Estimate parameters from data: least squares, their uncertainty, and particle swarms."""
