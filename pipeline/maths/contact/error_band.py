"""The variance of an external effort's error beyond what the filter says itself, by speed where it depends on speed.

It comes from free motion that no fit had seen: mean squares over blocks of a log and ranges of speed, less the filter's
own.  Logs count alike, however long they are.
"""

from typing import NamedTuple

import numpy as np

from pipeline.maths.arrays import Array, Booleans, Integers
from pipeline.maths.signals import jackknife

EDGES = (0.25, 0.5, 1.0, 1.5)  # of the ranges, in root mean squares of the identification's velocity
BINS = len(EDGES) + 1
BLOCKS = 6
FEWEST = 3  # logs, below which it is blocks that are left out for a standard error


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
    return beyond(of, together=not depends_on_speed(of))


def excess_std(of: SpeedCells) -> Array:
    """The standard error (BINS,) of that variance, from how logs differ, or blocks where there are hardly any logs."""
    if not len(of.samples):
        return np.zeros(BINS)
    together = not depends_on_speed(of)
    return jackknife.standard_error(lambda kept: beyond(of.those(kept), together), units(of)) * np.ones(BINS)


def beyond(of: SpeedCells, together: bool) -> Array:
    """The variance (BINS,) beyond the filter's own, by range of speed or of all ranges together."""
    return np.maximum(means(of, of.mean_square - of.filter_square, together), 0.0)


def units(of: SpeedCells) -> Integers:
    """Which of the parts that do not correlate each cell (C,) is of: its log, or its block where logs are few."""
    return of.source if len(np.unique(of.source)) >= FEWEST else of.source * BLOCKS + of.block


def means(of: SpeedCells, values: Array, together: bool) -> Array:
    """The mean (BINS,) of values of cells in each range, logs counting alike; of all ranges where `together`.

    A range that no log was in takes the mean of all.
    """
    total = _balanced(of, values, np.ones(len(values), np.bool_))
    if together:
        return np.full(BINS, total)
    each = [of.speed_bin == number for number in range(BINS)]
    return np.array([_balanced(of, values, own) if own.any() else total for own in each])


def depends_on_speed(of: SpeedCells) -> bool:
    """Whether variances by range of speed make blocks that are left out more likely than one variance does."""
    units = list(dict.fromkeys(zip(of.source.tolist(), of.block.tolist(), strict=True)))
    if len(units) < 3:
        return False
    gain = 0.0
    for source, block in units:
        out = (of.source == source) & (of.block == block)
        rest = of.those(~out)
        one, several = (means(rest, rest.mean_square, together)[of.speed_bin[out]] for together in (True, False))
        seen, weight = of.mean_square[out], of.samples[out] / of.samples[out].sum()
        gain += float(weight @ (np.log(one / several) + seen * (1.0 / one - 1.0 / several)))
    return gain > 0.0


def _balanced(of: SpeedCells, values: Array, which: Booleans) -> float:
    """The mean over logs of each log's mean over its samples."""
    sources = of.source[which]
    return float(np.mean([
        np.average(values[which][sources == source], weights=of.samples[which][sources == source])
        for source in np.unique(sources)
    ]))  # fmt: skip
