"""A signal over velocity, in both directions, separately for samples that gain and that lose speed."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans

RANGES = 20  # number of ranges in each direction, of equal width
MIN_SAMPLES_RANGE = 5  # a range with fewer samples is left out


class VelocityMap(NamedTuple):
    """Means over ranges of velocity, the slowest first; ranges with few samples are left out."""

    dq: Array  # (n,)
    gaining: Booleans  # (n,) whether the range is of samples that gain speed
    mean: Array  # (n, c) of c signals
    std: Array  # (n, c) standard deviations


def over_velocity(dq: Array, ddq: Array, signals: Array) -> VelocityMap:
    """Average signals (N, c) over ranges of the velocity dq (N,), separately by the sign of dq ddq."""
    edges = float(np.abs(dq).max() or 1.0) * np.linspace(-1.0, 1.0, 2 * RANGES + 1)
    range_of_sample = np.clip(np.digitize(dq, edges) - 1, 0, 2 * RANGES - 1)
    gaining = dq * ddq > 0
    groups = [(range_of_sample == n) & (gaining == way) for n in range(2 * RANGES) for way in (True, False)]
    parts = [part for part in groups if np.count_nonzero(part) >= MIN_SAMPLES_RANGE]
    shape = len(parts), signals.shape[1]
    mean, std = (np.array([f(signals[part], axis=0) for part in parts]).reshape(shape) for f in (np.mean, np.std))
    gains = np.array([gaining[part].all() for part in parts], np.bool_)
    return VelocityMap(np.array([dq[part].mean() for part in parts]), gains, mean, std)
