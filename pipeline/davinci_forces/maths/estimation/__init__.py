"""Estimate parameters from data: least squares and their uncertainty, conic programs, and drift."""
