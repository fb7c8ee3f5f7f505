"""Columns of numbers in text, with or without a header, in whatever delimiter and decimal mark."""

from davinci_forces.logs.text.reader import read, recognises

__all__ = ["read", "recognises"]
