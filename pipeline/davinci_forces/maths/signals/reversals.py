"""Where a joint moves one way, far from where its velocity passes through zero."""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans

BEFORE, AFTER = (
    0.05,
    0.25,
)  # [s] around a reversal that are left out: by then a filter that shows pushes has forgotten it
SLOW = 0.05  # of the root mean square of the velocity, below which friction may stick


def moving(dq: Array, T_s: float) -> Booleans:
    """Whether each sample of a velocity (N,), low-passed without delay, is far from any reversal and no standstill."""
    size = float(np.sqrt(np.mean(dq**2)))
    standing = np.abs(dq) <= SLOW * size
    standing[1:] |= np.sign(dq[1:]) != np.sign(dq[:-1])
    since = np.cumsum(np.concatenate([[0], standing]))
    k, N = np.arange(len(dq)), len(dq)
    first, last = np.maximum(k - round(AFTER / T_s), 0), np.minimum(k + round(BEFORE / T_s) + 1, N)
    return np.asarray(since[last] == since[first])
