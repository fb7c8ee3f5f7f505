"""How large an external effort looks where nothing touches the robot, and whether its stated band covers that."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, evenly
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, error_of_quantile

DETECTED = 0.99  # share of free-space samples below the detection level
USUAL = 0.95
NORMAL_95 = 1.959963984540054
MOST = 20_000  # samples that a bootstrap goes through; of more, evenly spaced ones


class FreeSpaceLevels(NamedTuple):
    """Levels of |tau_ext| in free space, with standard errors by block bootstrap."""

    rms: float
    rms_std: float
    level_95: float
    level_95_std: float
    level_99: float
    level_99_std: float
    coverage: float  # share of samples within 1.96 stated standard deviations
    coverage_std: float


def levels(tau_ext: Array, std: Array) -> FreeSpaceLevels:
    """The levels of an external effort (N,) whose stated standard deviation is `std` (N,), in free space."""
    few = evenly(len(tau_ext), MOST)
    size, inside = np.abs(tau_ext[few]), (np.abs(tau_ext[few]) <= NORMAL_95 * std[few]).astype(float)
    return FreeSpaceLevels(
        rms=float(np.sqrt(np.mean(size**2))),
        rms_std=error_of_pooled_mean(size**2, of=np.sqrt),
        level_95=float(np.quantile(size, USUAL)),
        level_95_std=error_of_quantile(size, USUAL),
        level_99=float(np.quantile(size, DETECTED)),
        level_99_std=error_of_quantile(size, DETECTED),
        coverage=float(np.mean(inside)),
        coverage_std=error_of_pooled_mean(inside),
    )
