"""What happened within a window of contact: peak, mean and impulse of the external effort, and how far to trust them.

The standard errors are what the same numbers come to where nothing touches the robot, model error included: of a peak
the root mean square of single samples, of a mean that of means over windows of the same length.
"""

from typing import NamedTuple

import numpy as np

from pipeline.maths.arrays import Array, Booleans


class Summary(NamedTuple):
    """One window of contact."""

    peak: float  # the largest sample, with its sign
    peak_std: float
    mean: float
    mean_std: float
    impulse: float  # mean times duration
    impulse_std: float


def summarise(t: Array, tau_ext: Array, window: tuple[float, float], free: Booleans) -> Summary | None:
    """Peak, mean and impulse of an external effort (N,) in a window [s]; None where no sample lies in it.

    `free` (N,) says at which samples nothing touches the robot.
    """
    start, end = window
    inside = tau_ext[(t >= start) & (t <= end)]
    if not len(inside):
        return None
    duration, mean = end - start, float(inside.mean())
    mean_std = mean_size(tau_ext, free, len(inside))
    sample_std = mean_size(tau_ext, free, 1)
    peak = float(inside[np.argmax(np.abs(inside))])
    return Summary(peak, sample_std, mean, mean_std, mean * duration, mean_std * duration)


def mean_size(tau_ext: Array, free: Booleans, length: int) -> float:
    """Root mean square of means over `length` samples in free space.

    Where no run of free samples is as long as that, of the longest means that there are; NaN where there are none.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]])))
    runs = [tau_ext[start:stop] for start, stop in edges.reshape(-1, 2)]
    longest = max(map(len, runs), default=0)
    if not longest:
        return float("nan")
    length = min(length, longest)
    means = [_moving_means(run, length) for run in runs if len(run) >= length]
    return float(np.sqrt(np.mean(np.concatenate(means) ** 2)))


def _moving_means(x: Array, length: int) -> Array:
    total = np.cumsum(np.concatenate([[0.0], x]))
    return np.asarray((total[length:] - total[:-length]) / length)
