"""The error variance of an external effort beyond that of the filter, by speed where it depends on speed.

It is estimated on free motion outside the fits: mean squares over blocks of a log and ranges of speed, less the
variance of the filter.  Logs have equal weight, whatever their length.  `levels` checks the coverage of the resulting
band on samples without contact.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, evenly
from davinci_forces.maths.uncertainty import bootstrap
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, error_of_quantile

EDGES = (0.25, 0.5, 1.0, 1.5)  # of the ranges, in root mean squares of the identification's velocity
BINS = len(EDGES) + 1
LOG_BLOCKS = 6
MIN_LOGS_BAND = 3  # logs; with fewer, standard errors leave out blocks instead
DETECTED_SHARE = 0.99  # share of free-space samples below the detection level
TYPICAL_SHARE = 0.95  # share of free-space samples below the lower level
NORMAL_95 = 1.959963984540054
MAX_SAMPLES_BOOTSTRAP = 20_000  # of more, evenly spaced ones


class SpeedCells(NamedTuple):
    """Blocks of logs at ranges of speed, (C,) each."""

    source: Integers  # which log
    block: Integers
    speed_bin: Integers
    samples: Integers
    mean_square: Array  # of the external effort
    filter_square: Array  # mean of the variance that the filter accounts for, its lag included
    log_mean: Array  # of the external effort over the whole log

    def select(self, which: Booleans) -> "SpeedCells":
        """Select cells."""
        return SpeedCells(*(column[which] for column in self))  # type: ignore[arg-type]


def speed_bin(dq: Array, speed: float) -> Integers:
    """Number of the range of speed of each sample (N,); `speed` is the RMS velocity of the identification."""
    return np.searchsorted(np.array(EDGES) * speed, np.abs(dq))


def cells(tau_ext: Array, variance: Array, dq: Array, speed: float) -> SpeedCells:
    """Average one log's free motion by cells: external effort (N,), the filter's variance (N,) and velocity (N,)."""
    block, bins = np.empty(len(dq), np.int64), speed_bin(dq, speed)
    for number, part in enumerate(np.array_split(np.arange(len(dq)), LOG_BLOCKS)):
        block[part] = number
    cell, inverse, count = np.unique(block * BINS + bins, return_inverse=True, return_counts=True)
    squares, filter_squares = (np.bincount(inverse, weights=x) / count for x in (tau_ext**2, variance))
    mean = np.full(len(cell), tau_ext.mean())
    return SpeedCells(np.zeros(len(cell), np.int64), cell // BINS, cell % BINS, count, squares, filter_squares, mean)


def subtract_log_means(of: SpeedCells) -> SpeedCells:
    """Subtract the squared mean of each log, as an offset of the day does."""
    return of._replace(mean_square=of.mean_square - of.log_mean**2)


def excess(of: SpeedCells) -> Array:
    """Variance (BINS,) beyond the filter's own; one value for all speeds where it does not depend on speed."""
    if not len(of.samples):
        return np.zeros(BINS)
    variances = means(of, of.mean_square - of.filter_square, together=not depends_on_speed(of))
    return np.maximum(variances, 0.0)


def excess_std(of: SpeedCells) -> Array:
    """Standard error (BINS,) of `excess`, by the jackknife over logs, or over blocks where logs are few."""
    if not len(of.samples):
        return np.zeros(BINS)
    left_out = without_each(of, of.mean_square - of.filter_square, units(of), together=not depends_on_speed(of))
    return bootstrap.of_left_out(np.maximum(left_out, 0.0))


def units(of: SpeedCells) -> Integers:
    """Uncorrelated unit of each cell (C,): its log, or its block where logs are few."""
    return of.source if len(np.unique(of.source)) >= MIN_LOGS_BAND else of.source * LOG_BLOCKS + of.block


def means(of: SpeedCells, values: Array, together: bool) -> Array:
    """Mean (BINS,) of cell values in each range, with equal weight of logs; of all ranges where `together`.

    An empty range gets the mean of all ranges.
    """
    totals, samples = sums(of, values, np.unique(of.source, return_inverse=True)[1])
    return _of_ranges(_ratio(totals, samples).sum(0), (samples > 0).sum(0), together)


def without_each(of: SpeedCells, values: Array, unit: Integers, together: bool) -> Array:
    """The means (U, BINS) of `means` without each unit of cells (C,) in turn; a unit belongs to one log.

    Leaving out a unit changes only the mean of its log, so all of them cost little more than one.
    """
    _, log = np.unique(of.source, return_inverse=True)
    _, first, part = np.unique(unit, return_index=True, return_inverse=True)
    totals, samples = sums(of, values, log)
    out, out_samples = sums(of, values, part)
    counts = samples[log[first]] - out_samples
    changed = _ratio(totals[log[first]] - out, counts) - _ratio(totals, samples)[log[first]]
    fewer = (counts > 0).astype(int) - (samples > 0)[log[first]]
    return _of_ranges(_ratio(totals, samples).sum(0) + changed, (samples > 0).sum(0) + fewer, together)


def sums(of: SpeedCells, values: Array, group: Integers) -> tuple[Array, Array]:
    """Sum values over samples, and samples, by group (C,) and range (G, BINS + 1); the last column is of all ranges."""
    shape = int(group.max()) + 1, BINS
    tables = (
        np.bincount(group * BINS + of.speed_bin, weights=x, minlength=shape[0] * BINS).reshape(shape)
        for x in (of.samples * values, of.samples)
    )
    weighted, samples = (np.column_stack([x, x.sum(1)]) for x in tables)
    return weighted, samples


def depends_on_speed(of: SpeedCells) -> bool:
    """Whether variances by range of speed give omitted blocks a higher likelihood than one variance does."""
    unit = np.unique(of.source * LOG_BLOCKS + of.block, return_inverse=True)[1]
    if unit.max() < 2:
        return False
    variances = (without_each(of, of.mean_square, unit, together) for together in (True, False))
    common, by_range = (variance[unit, of.speed_bin] for variance in variances)
    gain = np.log(common / by_range) + of.mean_square * (1.0 / common - 1.0 / by_range)
    return float(np.sum(of.samples / np.bincount(unit, weights=of.samples)[unit] * gain)) > 0.0


def _of_ranges(total: Array, logs: Integers, together: bool) -> Array:
    """Means (..., BINS) of sums over `logs` (..., BINS + 1), the last column of which is of all ranges."""
    mean = _ratio(total, logs)
    overall = np.broadcast_to(mean[..., -1:], mean[..., :-1].shape)
    return np.asarray(overall if together else np.where(logs[..., :-1] > 0, mean[..., :-1], overall))


def _ratio(total: Array, count: Array | Integers) -> Array:
    """Means; 0 where the count is 0."""
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
    """Levels of an external effort (N,) with stated standard deviation `std` (N,), in free space."""
    few = evenly(len(tau_ext), MAX_SAMPLES_BOOTSTRAP)
    size, inside = np.abs(tau_ext[few]), (np.abs(tau_ext[few]) <= NORMAL_95 * std[few]).astype(float)
    return FreeSpaceLevels(
        rms=float(np.sqrt(np.mean(size**2))),
        rms_std=error_of_pooled_mean(size**2, of=np.sqrt),
        level_95=float(np.quantile(size, TYPICAL_SHARE)),
        level_95_std=error_of_quantile(size, TYPICAL_SHARE),
        level_99=float(np.quantile(size, DETECTED_SHARE)),
        level_99_std=error_of_quantile(size, DETECTED_SHARE),
        coverage=float(np.mean(inside)),
        coverage_std=error_of_pooled_mean(inside),
    )
