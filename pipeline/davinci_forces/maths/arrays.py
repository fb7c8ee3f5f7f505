"""Types of arrays; docstrings give their shapes and units."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

BLOCK_SAMPLES = 1 << 18  # samples of a long recording that are worked on at once, so that memory does not limit it


def row_blocks(N: int) -> list[slice]:
    """Split N samples into blocks of `BLOCK_SAMPLES`, the last one shorter."""
    return [slice(start, min(start + BLOCK_SAMPLES, N)) for start in range(0, N, BLOCK_SAMPLES)]


def evenly(N: int, most: int) -> Integers:
    """Indices of at most `most` of N samples, evenly spaced, including the first and the last."""
    return np.linspace(0, N - 1, min(N, most)).round().astype(np.int64)


def records(columns: Any) -> NDArray[np.void]:
    """The columns (n,) of a named tuple as one array of records (n,), which is one argument of compiled code."""
    table = np.empty(len(columns[0]), [(name, float) for name in columns._fields])
    for name, column in zip(columns._fields, columns, strict=True):
        table[name] = column
    return table


def runs(which: Booleans) -> list[slice]:
    """The runs of true samples (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], which, [False]]))).reshape(-1, 2)
    return [slice(start, stop) for start, stop in edges.tolist()]
