"""How large an external effort looks where nothing touches the robot, and whether its stated band covers that."""

from typing import NamedTuple

import numpy as np

from pipeline.maths.arrays import Array, evenly
from pipeline.maths.signals.bootstrap import blocks, standard_error

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
    parts = blocks(len(few))
    sizes, insides = [size[part] for part in parts], [inside[part] for part in parts]
    values = []
    for statistic, columns in ((_rms, sizes), (_level_95, sizes), (_level_99, sizes), (_mean, insides)):
        values += [statistic(columns), standard_error(statistic, columns)]
    return FreeSpaceLevels(*values)


def _rms(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _level_95(parts: list[Array]) -> float:
    return float(np.quantile(np.concatenate(parts), USUAL))


def _level_99(parts: list[Array]) -> float:
    return float(np.quantile(np.concatenate(parts), DETECTED))


def _mean(parts: list[Array]) -> float:
    return float(np.mean(np.concatenate(parts)))
