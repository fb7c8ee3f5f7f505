"""Which errors on free motion tell how far a log's external effort may be off: never the log's own."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.uncertainty.error_band import BLOCKS, SpeedCells, centred, excess, excess_std, speed_bin
from davinci_forces.records import ErrorBand
from davinci_forces.records.prediction import ANOTHER_PATH

OWN = "its own other blocks"  # where there is nothing else


class ModelVariance(NamedTuple):
    """The variance (N,) of an external effort beyond the filter's own, its standard error (N,), and who tells them."""

    variance: Array
    std: Array
    told_by: str


def model_variance(band: ErrorBand, log: str, path: str, dq: Array, is_centred: bool) -> ModelVariance:
    """The variance of a log's external effort beyond the filter's own, along its velocity (N,).

    Of other logs those on a path of the same kind are taken, for on a fitted path a model's error repeats.  Where there
    are none, those on another path, which are larger; and where this log is all there is, of each of its blocks the
    other blocks.  `is_centred` is for efforts whose offset of the day was taken off.
    """
    source, others = np.asarray(band.source).astype(str), np.asarray(band.source).astype(str) != log
    kinds = np.asarray(band.path_of).astype(str)
    bins = speed_bin(dq, band.speed)
    for which in (others & (kinds == path), others & (kinds == ANOTHER_PATH), others):
        if which.any():
            names = ", ".join(dict.fromkeys(source[which]))
            own = rows(band, which, is_centred)
            return ModelVariance(excess(own)[bins], excess_std(own)[bins], names)
    variance, std = np.empty(len(dq)), np.empty(len(dq))
    for number, part in enumerate(np.array_split(np.arange(len(dq)), BLOCKS)):
        own = rows(band, band.block != number, is_centred)
        variance[part], std[part] = excess(own)[bins[part]], excess_std(own)[bins[part]]
    return ModelVariance(variance, std, OWN)


def rows(band: ErrorBand, which: Booleans, is_centred: bool) -> SpeedCells:
    """Some of the cells of a band."""
    _, source = np.unique(np.asarray(band.source).astype(str), return_inverse=True)
    every = SpeedCells(
        source, band.block, band.speed_bin, band.count, band.mean_square, band.filter_square, band.log_mean
    )
    some = every.those(which)
    return centred(some) if is_centred else some
