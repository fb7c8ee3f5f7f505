"""The day offset, a constant effort that differs from day to day: the mean without contact, and its drift."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.windows import is_outside
from davinci_forces.maths.uncertainty.bootstrap import blocks, error_of_mean

MIN_DRIFT_ERRORS = 2.0  # a difference of more standard errors is a drift


class DayOffset(NamedTuple):
    """An offset with its standard error, and its drift from the first to the second half of the samples."""

    value: float
    std: float
    drift: float
    drift_std: float

    @property
    def drifts(self) -> bool:
        """Whether the halves differ by more than `MIN_DRIFT_ERRORS` standard errors."""
        return abs(self.drift) > MIN_DRIFT_ERRORS * self.drift_std


def day_offset(t: Array, residual: Array, windows: Sequence[tuple[float, float]]) -> DayOffset:
    """Average the residual effort (N,) of a model in windows [s] in which nothing touches the robot.

    Without windows, or with fewer than two samples in them, the offset is 0 with error 0.
    """
    inside = residual[~is_outside(t, windows)]
    if len(inside) < 2:
        return DayOffset(0.0, 0.0, 0.0, 0.0)
    (first, first_std), (last, last_std), (value, std) = map(_mean, (*np.array_split(inside, 2), inside))
    return DayOffset(value, std, last - first, float(np.hypot(first_std, last_std)))


def _mean(x: Array) -> tuple[float, float]:
    """The mean of correlated samples and its standard error."""
    parts = [float(x[part].mean()) for part in blocks(len(x))]
    return float(x.mean()), error_of_mean(parts) if len(parts) > 1 else float(abs(x[0]))
