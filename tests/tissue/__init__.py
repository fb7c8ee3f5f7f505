"""Tests of pushes into tissue."""
