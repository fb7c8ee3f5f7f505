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
    groups = [(range_of_sample == n) & (gaining == gains) for n in range(2 * RANGES) for gains in (True, False)]
    parts = [part for part in groups if np.count_nonzero(part) >= MIN_SAMPLES_RANGE]
    mean, std = (np.array([f(signals[part], axis=0) for part in parts]) for f in (np.mean, np.std))
    dq_of_parts, gains = (np.array([x[part].mean() for part in parts]) for x in (dq, gaining))
    columns = (x.reshape(len(parts), signals.shape[1]) for x in (mean, std))
    return VelocityMap(dq_of_parts, gains > 0.0, *columns)
