"""What an effort is off on the day of a log: its mean where nothing touches the robot, and whether that drifts."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.windows import outside
from davinci_forces.maths.uncertainty.bootstrap import blocks, error_of_mean

BEYOND = 2.0  # standard errors of a difference, from which on it is a drift


class DayOffset(NamedTuple):
    """An offset with its standard error, and by how much its samples' second half differs from the first."""

    value: float
    std: float
    drift: float
    drift_std: float

    @property
    def drifts(self) -> bool:
        """Whether the two halves differ by more than their standard errors explain."""
        return abs(self.drift) > BEYOND * self.drift_std


def day_offset(t: Array, left: Array, windows: Sequence[tuple[float, float]]) -> DayOffset:
    """The mean of the effort (N,) that a model leaves, in windows [s] in which nothing touches the robot.

    Without windows, or samples in them, nothing is known: an offset of 0 without error.
    """
    inside = left[~outside(t, windows)]
    if len(inside) < 2:
        return DayOffset(0.0, 0.0, 0.0, 0.0)
    halves = np.array_split(inside, 2)
    (first, first_std), (last, last_std) = (_mean(half) for half in halves)
    value, std = _mean(inside)
    return DayOffset(value, std, last - first, float(np.hypot(first_std, last_std)))


def _mean(x: Array) -> tuple[float, float]:
    """The mean of correlated samples and its standard error."""
    parts = [float(x[part].mean()) for part in blocks(len(x))]
    return float(x.mean()), error_of_mean(parts) if len(parts) > 1 else float(abs(x[0]))
