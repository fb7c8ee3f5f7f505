"""Thinning marks of many samples, without hiding an extreme."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array, row_blocks
from davinci_forces.report.content.marks import AnyMark, Band, Line, Points, Stems

Indices = NDArray[np.intp]


def thin_mark(mark: AnyMark, limit: int) -> AnyMark:
    """The mark in at most `limit` points; a smaller mark, or a band whose x decreases, stays unchanged."""
    if not isinstance(mark, Line | Points | Band | Stems) or points_of(mark) <= limit:
        return mark
    if isinstance(mark, Band):
        if not is_sorted(mark.x):
            return mark
        starts = _range_starts(mark.x, limit // 2)
        lower, upper = np.fmin.reduceat(mark.lower, starts), np.fmax.reduceat(mark.upper, starts)
        return replace(mark, x=mark.x[starts], lower=lower, upper=upper)
    if is_sorted(mark.x):
        indices = envelope(mark.x, mark.y, limit // 2)
    else:
        indices = np.arange(0, len(mark.x), -(-len(mark.x) // limit))
    columns: dict[str, Any] = {"x": mark.x[indices], "y": mark.y[indices]}
    if isinstance(mark, Points) and mark.y_std is not None:
        columns["y_std"] = mark.y_std[indices]
    return replace(mark, **columns)


def envelope(x: Array, y: Array, bins: int) -> Indices:
    """Indices of the smallest and the largest sample in each of `bins` equal ranges of x, in order.

    An extreme is never lost, however short; a range without a finite sample keeps one, so that a gap stays a gap.
    x (N,) must not decrease; returns (n,) indices, n <= 2 bins.
    """
    starts = _range_starts(x, bins)
    number = np.repeat(np.arange(len(starts), dtype=np.int32), np.diff(starts, append=len(x)))
    indices = [starts[np.isnan(np.fmin.reduceat(y, starts))]]
    for extreme in (np.fmin, np.fmax):
        at = np.flatnonzero(y == extreme.reduceat(y, starts)[number])
        indices.append(at[np.diff(number[at], prepend=-1) > 0])
    return np.unique(np.concatenate(indices))


def _range_starts(x: Array, bins: int) -> Indices:
    """The first sample of each of the equal ranges of x that contain samples."""
    ranges = np.empty(len(x), np.int32)
    for rows in row_blocks(len(x)):
        ranges[rows] = np.minimum((x[rows] - x[0]) / ((x[-1] - x[0]) or 1.0) * bins, bins - 1)
    return np.append(0, np.flatnonzero(ranges[1:] != ranges[:-1]) + 1)


def is_sorted(x: Array) -> bool:
    """Whether x never decreases, as time does."""
    return bool(np.all(x[1:] >= x[:-1]))


def points_of(mark: AnyMark) -> int:
    """Points that a mark puts on the page: two for each sample of a band."""
    return len(mark.x) * (2 if isinstance(mark, Band) else 1) if isinstance(mark, Line | Points | Band | Stems) else 0
