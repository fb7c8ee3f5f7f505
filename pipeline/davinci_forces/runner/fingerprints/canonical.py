"""The hash of a value by all that it holds, which is the same in every process and on every machine."""

from dataclasses import fields, is_dataclass
from datetime import date, time
from enum import Enum
from hashlib import sha256
from pathlib import PurePath
from typing import Any

import numpy as np

PLAIN = (str, float, int, bool, type(None))


def hash_of_text(text: str) -> str:
    """The sha256 of a text."""
    return sha256(text.encode()).hexdigest()


def hash_of(value: Any) -> str:
    """The sha256 of a value by all that it holds: arrays by their bytes, of which `repr` shows a few digits."""
    return hash_of_text(canonical(value))


def canonical(value: Any) -> str:
    """A text that two values share only if they hold the same.

    Raises
    ------
    TypeError
        If the value holds something of which that cannot be said.
    """
    if type(value) in PLAIN:  # most of what anything holds
        return repr(value)
    if is_dataclass(value) and not isinstance(value, type):
        items = (f"{f.name}={canonical(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({', '.join(items)})"
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"array({value.dtype.str}, {value.shape}, {sha256(value.tobytes()).hexdigest()})"
    if isinstance(value, dict):
        return f"{{{', '.join(sorted(f'{canonical(k)}: {canonical(v)}' for k, v in value.items()))}}}"
    if isinstance(value, list | tuple):
        return f"{type(value).__name__}({', '.join(map(canonical, value))})"
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, PurePath):
        return f"path({value.as_posix()!r})"
    if isinstance(value, np.generic):
        return canonical(value.item())
    if isinstance(value, int | float | str | date | time):
        return repr(value)
    raise TypeError(f"a {type(value).__name__} has no canonical text")
