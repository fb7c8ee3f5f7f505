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

EDGES = (0.25, 0.5, 1.0, 1.5)  # between ranges of speed, in root mean squares of the identification's velocity
BINS = len(EDGES) + 1
LOG_BLOCKS = 6
MIN_LOGS_BAND = 3  # with fewer logs, standard errors leave out blocks instead
DETECTED_SHARE = 0.99  # share of free-space samples below the detection level
TYPICAL_SHARE = 0.95  # share of free-space samples below the lower level
NORMAL_95 = 1.959963984540054
MAX_SAMPLES_BOOTSTRAP = 20_000  # of more samples, evenly spaced ones are drawn


class SpeedCells(NamedTuple):
    """Blocks of logs at ranges of speed, (C,) each."""

    source: Integers  # number of the log
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


def subtract_log_means(data: SpeedCells) -> SpeedCells:
    """Subtract the squared mean of each log, as the subtraction of the log's constant day offset does."""
    return data._replace(mean_square=data.mean_square - data.log_mean**2)


def excess(data: SpeedCells) -> Array:
    """Variance (BINS,) beyond the filter's own; one value for all speeds if it does not depend on speed."""
    if not len(data.samples):
        return np.zeros(BINS)
    variances = means(data, data.mean_square - data.filter_square, together=not depends_on_speed(data))
    return np.maximum(variances, 0.0)


def excess_std(data: SpeedCells) -> Array:
    """Standard error (BINS,) of `excess`, by the jackknife over logs, or over blocks if logs are few."""
    if not len(data.samples):
        return np.zeros(BINS)
    left_out = without_each(data, data.mean_square - data.filter_square, units(data), not depends_on_speed(data))
    return bootstrap.of_left_out(np.maximum(left_out, 0.0))


def units(data: SpeedCells) -> Integers:
    """Uncorrelated unit of each cell (C,): its log, or its block if logs are few."""
    return data.source if len(np.unique(data.source)) >= MIN_LOGS_BAND else data.source * LOG_BLOCKS + data.block


def means(data: SpeedCells, values: Array, together: bool) -> Array:
    """Mean (BINS,) of cell values in each range, with equal weight of logs; one mean of all ranges if `together`.

    An empty range gets the mean of all ranges.
    """
    totals, samples = sums(data, values, np.unique(data.source, return_inverse=True)[1])
    return _of_ranges(_ratio(totals, samples).sum(0), (samples > 0).sum(0), together)


def without_each(data: SpeedCells, values: Array, unit: Integers, together: bool) -> Array:
    """The means (U, BINS) of `means` without each unit of cells (C,) in turn; a unit belongs to one log.

    Leaving out a unit changes only the mean of its log, so all U means cost little more than one.
    """
    _, log = np.unique(data.source, return_inverse=True)
    _, first, part = np.unique(unit, return_index=True, return_inverse=True)
    totals, samples = sums(data, values, log)
    out, out_samples = sums(data, values, part)
    counts = samples[log[first]] - out_samples
    changed = _ratio(totals[log[first]] - out, counts) - _ratio(totals, samples)[log[first]]
    fewer = (counts > 0).astype(int) - (samples > 0)[log[first]]
    return _of_ranges(_ratio(totals, samples).sum(0) + changed, (samples > 0).sum(0) + fewer, together)


def sums(data: SpeedCells, values: Array, group: Integers) -> tuple[Array, Array]:
    """Sum values over samples, and samples, by group (C,) and range (G, BINS + 1); the last column is the total."""
    shape = int(group.max()) + 1, BINS
    tables = (
        np.bincount(group * BINS + data.speed_bin, weights=x, minlength=shape[0] * BINS).reshape(shape)
        for x in (data.samples * values, data.samples)
    )
    weighted, samples = (np.column_stack([x, x.sum(1)]) for x in tables)
    return weighted, samples


def depends_on_speed(data: SpeedCells) -> bool:
    """Whether variances by range of speed give omitted blocks a higher likelihood than one variance for all speeds."""
    unit = np.unique(data.source * LOG_BLOCKS + data.block, return_inverse=True)[1]
    if unit.max() < 2:
        return False
    variances = (without_each(data, data.mean_square, unit, together) for together in (True, False))
    common, by_range = (variance[unit, data.speed_bin] for variance in variances)
    gain = np.log(common / by_range) + data.mean_square * (1.0 / common - 1.0 / by_range)
    return float(np.sum(data.samples / np.bincount(unit, weights=data.samples)[unit] * gain)) > 0.0


def _of_ranges(total: Array, logs: Integers, together: bool) -> Array:
    """Means (..., BINS) of sums over `logs` (..., BINS + 1), whose last column is for all ranges."""
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
    samples = evenly(len(tau_ext), MAX_SAMPLES_BOOTSTRAP)
    size, inside = np.abs(tau_ext[samples]), (np.abs(tau_ext[samples]) <= NORMAL_95 * std[samples]).astype(float)
    return FreeSpaceLevels(
        rms=float(np.sqrt(np.mean(size**2))),
        rms_std=error_of_pooled_mean(size**2, function=np.sqrt),
        level_95=float(np.quantile(size, TYPICAL_SHARE)),
        level_95_std=error_of_quantile(size, TYPICAL_SHARE),
        level_99=float(np.quantile(size, DETECTED_SHARE)),
        level_99_std=error_of_quantile(size, DETECTED_SHARE),
        coverage=float(np.mean(inside)),
        coverage_std=error_of_pooled_mean(inside),
    )
