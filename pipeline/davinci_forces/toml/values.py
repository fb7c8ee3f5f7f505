"""Values of TOML: which are numbers, and how they are shown in a problem."""

import sys
from typing import Any


def is_number(value: Any) -> bool:
    """Whether a value of TOML is a number that a float holds: neither inf nor nan, nor an integer beyond both."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def are_numbers(value: Any, count: int | None = None) -> bool:
    """Whether a value is a list of such numbers, as many as asked for."""
    return isinstance(value, list) and all(map(is_number, value)) and count in (None, len(value))


def shown(value: Any) -> str:
    """A value as a problem shows it, cut where it is long."""
    try:
        text = repr(value)
    except ValueError:  # more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:76]} ..."
