"""The variance of an external effort's error beyond what the filter says itself, by speed where it depends on speed.

It comes from free motion that no fit had seen: mean squares over blocks of a log and ranges of speed, less the filter's
own.  Logs count alike, however long they are.  Whether the stated band then covers what the effort looks like where
nothing touches the robot, `levels` says.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, evenly
from davinci_forces.maths.uncertainty import bootstrap
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, error_of_quantile

EDGES = (0.25, 0.5, 1.0, 1.5)  # of the ranges, in root mean squares of the identification's velocity
BINS = len(EDGES) + 1
BLOCKS = 6
FEWEST = 3  # logs, below which it is blocks that are left out for a standard error
DETECTED = 0.99  # share of free-space samples below the detection level
USUAL = 0.95
NORMAL_95 = 1.959963984540054
MOST = 20_000  # samples that a bootstrap goes through; of more, evenly spaced ones


class SpeedCells(NamedTuple):
    """Blocks of logs at ranges of speed, (C,) each."""

    source: Integers  # which log
    block: Integers
    speed_bin: Integers
    samples: Integers
    mean_square: Array  # of the external effort
    filter_square: Array  # mean of the variance that the filter accounts for, its lag included
    log_mean: Array  # of the external effort over the whole log

    def those(self, which: Booleans) -> "SpeedCells":
        """Some of the cells."""
        return SpeedCells(*(column[which] for column in self))  # type: ignore[arg-type]


def speed_bin(dq: Array, speed: float) -> Integers:
    """The range of speed of each sample (N,); `speed` is the root mean square of the identification's velocity."""
    return np.searchsorted(np.array(EDGES) * speed, np.abs(dq))


def cells(tau_ext: Array, variance: Array, dq: Array, speed: float) -> SpeedCells:
    """The cells of one log's free motion: external effort (N,), the filter's variance (N,) and velocity (N,)."""
    block, bins = np.empty(len(dq), np.int64), speed_bin(dq, speed)
    for number, part in enumerate(np.array_split(np.arange(len(dq)), BLOCKS)):
        block[part] = number
    cell, inverse, count = np.unique(block * BINS + bins, return_inverse=True, return_counts=True)
    squares, own = (np.bincount(inverse, weights=x) / count for x in (tau_ext**2, variance))
    mean = np.full(len(cell), tau_ext.mean())
    return SpeedCells(np.zeros(len(cell), np.int64), cell // BINS, cell % BINS, count, squares, own, mean)


def centred(of: SpeedCells) -> SpeedCells:
    """Of efforts whose offset of the day was taken off."""
    return of._replace(mean_square=of.mean_square - of.log_mean**2)


def excess(of: SpeedCells) -> Array:
    """The variance (BINS,) beyond the filter's own; the same at all speeds where speed does not tell more."""
    if not len(of.samples):
        return np.zeros(BINS)
    left = means(of, of.mean_square - of.filter_square, together=not depends_on_speed(of))
    return np.maximum(left, 0.0)


def excess_std(of: SpeedCells) -> Array:
    """The standard error (BINS,) of that variance, from how logs differ, or blocks where there are hardly any logs."""
    if not len(of.samples):
        return np.zeros(BINS)
    left_out = without_each(of, of.mean_square - of.filter_square, units(of), together=not depends_on_speed(of))
    return bootstrap.of_left_out(np.maximum(left_out, 0.0))


def units(of: SpeedCells) -> Integers:
    """Which of the parts that do not correlate each cell (C,) is of: its log, or its block where logs are few."""
    return of.source if len(np.unique(of.source)) >= FEWEST else of.source * BLOCKS + of.block


def means(of: SpeedCells, values: Array, together: bool) -> Array:
    """The mean (BINS,) of values of cells in each range, logs counting alike; of all ranges where `together`.

    A range that no log was in takes the mean of all.
    """
    own, samples = sums(of, values, np.unique(of.source, return_inverse=True)[1])
    return _of_ranges(_ratio(own, samples).sum(0), (samples > 0).sum(0), together)


def without_each(of: SpeedCells, values: Array, unit: Integers, together: bool) -> Array:
    """The same means (U, BINS) without the cells of each of the parts (C,), in order, of which each is of one log.

    What leaving a part out changes is the mean of its own log, so that all of them take little more than one.
    """
    _, log = np.unique(of.source, return_inverse=True)
    _, first, part = np.unique(unit, return_index=True, return_inverse=True)
    own, samples = sums(of, values, log)
    left, kept = (every[log[first]] - out for every, out in zip((own, samples), sums(of, values, part), strict=True))
    changed = _ratio(left, kept) - _ratio(own, samples)[log[first]]
    fewer = (kept > 0).astype(int) - (samples > 0)[log[first]]
    return _of_ranges(_ratio(own, samples).sum(0) + changed, (samples > 0).sum(0) + fewer, together)


def sums(of: SpeedCells, values: Array, group: Integers) -> tuple[Array, Array]:
    """Sums (G, BINS + 1) of values over samples, and of samples, by groups (C,) and range; last of all ranges."""
    shape = int(group.max()) + 1, BINS
    each = (
        np.bincount(group * BINS + of.speed_bin, weights=x, minlength=shape[0] * BINS).reshape(shape)
        for x in (of.samples * values, of.samples)
    )
    weighted, samples = (np.column_stack([x, x.sum(1)]) for x in each)
    return weighted, samples


def depends_on_speed(of: SpeedCells) -> bool:
    """Whether variances by range of speed make blocks that are left out more likely than one variance does."""
    unit = np.unique(of.source * BLOCKS + of.block, return_inverse=True)[1]
    if unit.max() < 2:
        return False
    one, several = (without_each(of, of.mean_square, unit, together)[unit, of.speed_bin] for together in (True, False))
    gain = np.log(one / several) + of.mean_square * (1.0 / one - 1.0 / several)
    return float(np.sum(of.samples / np.bincount(unit, weights=of.samples)[unit] * gain)) > 0.0


def _of_ranges(total: Array, logs: Integers, together: bool) -> Array:
    """The means (..., BINS) of sums over so many logs (..., BINS + 1), the last of which is of all ranges."""
    mean = _ratio(total, logs)
    every = np.broadcast_to(mean[..., -1:], mean[..., :-1].shape)
    return np.asarray(every if together else np.where(logs[..., :-1] > 0, mean[..., :-1], every))


def _ratio(total: Array, count: Array | Integers) -> Array:
    """Means; zero of nothing."""
    return np.divide(total, count, out=np.zeros(np.shape(total)), where=count > 0)


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
