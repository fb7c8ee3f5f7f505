"""The log readers against what LabVIEW wrote, what was put in, and damage of every kind."""
