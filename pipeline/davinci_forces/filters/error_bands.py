"""The variance of a log's smoothed external effort, and the alarm level of a joint, from free motion of its logs."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.contact.detection import alarm_level
from davinci_forces.maths.uncertainty.error_band import LOG_BLOCKS, FreeErrors, calibrate
from davinci_forces.records import ErrorBand, FreeSpace, Streamed
from davinci_forces.records.prediction import ANOTHER_PATH

OTHER_BLOCKS = "its own other blocks"  # the source if there is no other log
Free = TypeVar("Free", bound=FreeSpace | Streamed)  # the free motion of a joint in a log, whole or as samples arrive


def total_variance(
    band: ErrorBand, log: str, path: str, dq: Array, own: Array, is_centred: bool
) -> tuple[Array, Array, str]:
    """Compute the variance (N,) of a log's smoothed effort from the smoother's own deviation and velocity (N,).

    Its standard error (N,) and its source, logs or blocks of this log, are returned, too.
    The errors are those of other logs on a path of the same kind, because on a fitted path a model's error repeats.
    Without such logs, the larger errors on another path are used.  If there is no other log, the variance of a block is
    that of the other blocks.  `is_centred` is for efforts whose day offset was subtracted.
    """
    source, kinds, errors = band.source.astype(str), band.path_of.astype(str), free_errors(band, is_centred)
    others = source != log
    for which in (others & (kinds == path), others & (kinds == ANOTHER_PATH), others):
        if which.any():
            calibration = calibrate(errors.select(which))
            variance = calibration.variance(own, dq)
            std = 2.0 * calibration.relative_std * variance
            return variance, std, ", ".join(dict.fromkeys(source[which]))
    variance, std = own**2, np.zeros(len(dq))
    for number, part in enumerate(np.array_split(np.arange(len(dq)), LOG_BLOCKS)):
        if (band.block != number).any():
            calibration = calibrate(errors.select(band.block != number))
            variance[part] = calibration.variance(own[part], dq[part])
            std[part] = 2.0 * calibration.relative_std * variance[part]
    return variance, std, OTHER_BLOCKS


def free_errors(band: ErrorBand, is_centred: bool) -> FreeErrors:
    """Return the errors of a band; without the mean of each log if `is_centred`."""
    _, source, count = np.unique(band.source.astype(str), return_inverse=True, return_counts=True)
    means = np.bincount(source, weights=band.tau_ext_smooth) / count
    error = band.tau_ext_smooth - means[source] * is_centred
    return FreeErrors(source, band.block, band.dq, error, band.tau_ext_std_filter, band.uncorrelated)


def joint_alarm_level(spaces: Sequence[Free]) -> tuple[float, Free]:
    """The alarm level of a joint over the free motion of its logs, and the log that gives it.

    A fitted log shows less of the model's error than others, so beside others it counts by its largest effort alone.
    """
    others = [space for space in spaces if space.role != "identification"] or spaces
    levels = [(alarm_level(space.free_rms, space.free_max, space.crossings), space) for space in others]
    return max([*levels, *((space.free_max, space) for space in spaces)], key=lambda pair: pair[0])
