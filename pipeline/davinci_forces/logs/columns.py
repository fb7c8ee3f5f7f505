"""Columns of Arrow as numpy has them; Arrow's own way loads pandas, which takes longer than reading a short log."""

from typing import TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array, Booleans, Integers

Number = TypeVar("Number", np.float64, np.int64)


def numbers(column: pa.ChunkedArray) -> Array:
    """A column of doubles (N,), NaN where it has no value."""
    values = _values(column, np.float64)
    if column.null_count:
        values[absent(column)] = np.nan
    return values


def integers(column: pa.ChunkedArray) -> Integers:
    """A column of whole numbers of 64 bits (N,), any where it has no value."""
    return _values(column, np.int64)


def absent(column: pa.ChunkedArray) -> Booleans:
    """Where a column (N,) has no value."""
    return ~np.concatenate([_present(chunk) for chunk in column.chunks] or [np.empty(0, bool)])


def _values(column: pa.ChunkedArray, dtype: type[Number]) -> NDArray[Number]:
    chunks = ((chunk, np.frombuffer(chunk.buffers()[1] or b"", dtype)) for chunk in column.chunks)
    parts = [values[chunk.offset : chunk.offset + len(chunk)] for chunk, values in chunks]
    return np.concatenate(parts or [np.empty(0, dtype)])


def _present(chunk: pa.Array) -> Booleans:
    """Where a chunk has a value: one bit each, that of the first is the lowest."""
    bits = chunk.buffers()[0] if chunk.null_count else None
    if bits is None:
        return np.full(len(chunk), not chunk.null_count)
    all_bits = np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little")
    return all_bits[chunk.offset : chunk.offset + len(chunk)].view(bool)
