"""Which samples of a recording are evaluated."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans

SETTLE = 1.0  # [s] of a filter's transient, left out of the statistics of the whole run


def outside(t: Array, windows: Sequence[tuple[float, float]]) -> Booleans:
    """Whether each time (N,) lies outside all windows."""
    inside = np.zeros(len(t), dtype=bool)
    for start, end in windows:
        inside |= (t >= start) & (t <= end)
    return ~inside


def settled(t: Array) -> Booleans:
    """Whether a filter's transient is over: all but the first second, unless there is little more than that."""
    return t - t[0] >= SETTLE if t[-1] - t[0] > 5 * SETTLE else np.ones(len(t), dtype=bool)


def free_space(t: Array, windows: Sequence[tuple[float, float]], rate: float) -> Booleans:
    """Whether nothing touches the robot at each time (N,), and no filter is still settling: at the start, after each
    gap, and after each window; `rate` [Hz].
    """
    after = [(start, end + SETTLE) for start, end in windows]
    gaps = [0, *(np.flatnonzero(np.diff(t) > 1.5 / rate) + 1).tolist(), len(t)]
    calm = np.concatenate([settled(t[a:b]) for a, b in pairwise(gaps)])
    return np.asarray(outside(t, after) & calm)


def runs(which: Booleans) -> list[slice]:
    """The runs of samples (N,) that count."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], which, [False]]))).reshape(-1, 2)
    return [slice(start, stop) for start, stop in edges.tolist()]


def longest_run(t: Array, rate: float) -> slice:
    """The longest segment, a run of samples without a gap; `rate` [Hz]."""
    edges = [0, *(np.flatnonzero(np.diff(t) > 1.5 / rate) + 1).tolist(), len(t)]
    return max((slice(a, b) for a, b in pairwise(edges)), key=lambda part: part.stop - part.start)
