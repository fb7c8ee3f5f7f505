"""The model error of a log's external effort, estimated from free motion of other logs."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.uncertainty.error_band import (
    LOG_BLOCKS,
    SpeedCells,
    excess,
    excess_std,
    speed_bin,
    subtract_log_means,
)
from davinci_forces.records import ErrorBand
from davinci_forces.records.prediction import ANOTHER_PATH

OTHER_BLOCKS = "its own other blocks"  # the source if there is no other log


class ModelVariance(NamedTuple):
    """The variance (N,) of an external effort beyond the filter's, its standard error (N,), and their source."""

    variance: Array
    std: Array
    source: str  # logs, or blocks of this log


def model_variance(band: ErrorBand, log: str, path: str, dq: Array, is_centred: bool) -> ModelVariance:
    """Compute the variance of a log's external effort beyond the filter's, along its velocity (N,).

    The errors are those of other logs on a path of the same kind, because on a fitted path a model's error repeats.
    Without such logs, the larger errors on another path are used.  If there is no other log, the variance of a block is
    that of the other blocks.  `is_centred` is for efforts whose day offset was subtracted.
    """
    source, others = np.asarray(band.source).astype(str), np.asarray(band.source).astype(str) != log
    kinds = np.asarray(band.path_of).astype(str)
    bins = speed_bin(dq, band.speed)
    for which in (others & (kinds == path), others & (kinds == ANOTHER_PATH), others):
        if which.any():
            names = ", ".join(dict.fromkeys(source[which]))
            cells = select_cells(band, which, is_centred)
            return ModelVariance(excess(cells)[bins], excess_std(cells)[bins], names)
    variance, std = np.empty(len(dq)), np.empty(len(dq))
    for number, part in enumerate(np.array_split(np.arange(len(dq)), LOG_BLOCKS)):
        cells = select_cells(band, band.block != number, is_centred)
        variance[part], std[part] = excess(cells)[bins[part]], excess_std(cells)[bins[part]]
    return ModelVariance(variance, std, OTHER_BLOCKS)


def select_cells(band: ErrorBand, which: Booleans, is_centred: bool) -> SpeedCells:
    """Return the selected cells of a band; without the mean of each log if `is_centred`."""
    _, source = np.unique(np.asarray(band.source).astype(str), return_inverse=True)
    sums = (band.count, band.mean_square, band.filter_square, band.log_mean)
    cells = SpeedCells(source, band.block, band.speed_bin, *sums).select(which)
    return subtract_log_means(cells) if is_centred else cells
