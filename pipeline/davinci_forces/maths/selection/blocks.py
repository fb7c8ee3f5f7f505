"""Parts of a path, to be left out one at a time: what is predicted there has not been seen, nor anything near it.

Leaving a period out repeats the path in what is kept, and rewards every column; a block of path does not.
"""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers

BLOCKS = 6  # of a period, or of a recording that does not repeat
MOST = 20  # groups at most that are left out, one refit each


def path_blocks(t: Array, period: float, moving: Booleans | None = None) -> Integers:
    """The block of the path, 0 to 5, that each sample (N,) is in: the sixth of its period, or of the recording.

    `t` [s]; a `period` of 0 [s] is that of a recording that does not repeat, of which sixths of what is `moving` (N,)
    are taken, all where it is left out.
    """
    since = t - t[0]
    if moving is not None and not moving.all() and not period:
        since = np.concatenate([[0.0], np.cumsum(np.diff(t) * moving[1:])])
    length = period or float(since[-1]) * (1 + 1e-9) or 1.0
    return np.asarray((since / length % 1.0 * BLOCKS).astype(np.int64) % BLOCKS)


def repetitions(t: Array, period: float) -> Integers:
    """The period, from 0, that each sample (N,) is in; the last one need not be whole."""
    return np.asarray(((t - t[0]) / period + 1e-9).astype(np.int64))


def left_out(log: Integers, block: Integers) -> tuple[Booleans, ...]:
    """Which cells (C,), each a block of one log, every group leaves out: schemes of groups (G, C).

    Sixths of the path, its halves, and where there are several, each log, together at most `MOST` groups.
    """
    logs = np.unique(log)
    sixths = block == np.arange(BLOCKS)[:, None]
    halves = block // (BLOCKS // 2) == np.arange(2)[:, None]
    room = MOST - BLOCKS - 2
    together = np.searchsorted(logs, log) * min(room, len(logs)) // len(logs)
    by_log = together == np.arange(min(room, len(logs)))[:, None]
    return (sixths, halves, by_log) if len(logs) > 1 else (sixths, halves)
