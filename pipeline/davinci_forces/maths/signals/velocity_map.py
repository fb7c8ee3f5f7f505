"""A signal over velocity, in both directions, and while it gains speed and while it loses speed."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans

RANGES = 20  # of equal width, in each direction
FEWEST = 5  # samples in a range that is shown


class VelocityMap(NamedTuple):
    """Means over ranges of velocity, the slowest first; ranges with few samples are left out."""

    dq: Array  # (n,)
    gaining: Booleans  # (n,) whether the range is of samples that gain speed
    mean: Array  # (n, c) of c signals
    std: Array  # (n, c) standard deviations


def over_velocity(dq: Array, ddq: Array, signals: Array) -> VelocityMap:
    """Means of signals (N, c) over ranges of the velocity dq (N,), by whether dq ddq is positive."""
    edges = float(np.abs(dq).max() or 1.0) * np.linspace(-1.0, 1.0, 2 * RANGES + 1)
    place = np.clip(np.digitize(dq, edges) - 1, 0, 2 * RANGES - 1)
    gaining = dq * ddq > 0
    made = []
    for number in range(2 * RANGES):
        for gains in (True, False):
            own = (place == number) & (gaining == gains)
            if np.count_nonzero(own) >= FEWEST:
                made.append((dq[own].mean(), gains, signals[own].mean(axis=0), signals[own].std(axis=0)))
    if not made:
        return VelocityMap(np.empty(0), np.empty(0, np.bool_), *(np.empty((0, signals.shape[1])) for _ in range(2)))
    columns = (np.array(column) for column in zip(*made, strict=True))
    return VelocityMap(*columns)
