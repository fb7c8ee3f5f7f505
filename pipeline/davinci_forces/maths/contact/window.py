"""What happened within a window of contact: peak, mean and impulse of the external effort, and how far to trust them.

The standard errors are what the same numbers come to where nothing touches the robot, model error included: of a peak
the root mean square of the largest samples of windows of the same length, of a mean that of means over such windows.  A
peak may be off by what the effort's own deviation is near it, too, which knows how far a filter lags behind.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.windows import runs

NEAR = 0.2  # [s] of a peak, within which a filter's lag passes through its largest


class Summary(NamedTuple):
    """One window of contact."""

    peak: float  # the largest sample, with its sign
    peak_std: float
    mean: float
    mean_std: float
    impulse: float  # mean times duration
    impulse_std: float


def summarise(t: Array, tau_ext: Array, std: Array, window: tuple[float, float], free: Booleans) -> Summary | None:
    """Peak, mean and impulse of an external effort (N,) with deviation (N,) in a window [s]; None where it is empty.

    `free` (N,) says at which samples nothing touches the robot.
    """
    start, end = window
    inside = tau_ext[(t >= start) & (t <= end)]
    if not len(inside):
        return None
    duration, mean = end - start, float(inside.mean())
    mean_std = mean_size(tau_ext, free, len(inside))
    k = int(np.searchsorted(t, start)) + int(np.argmax(np.abs(inside)))
    own = float(std[np.abs(t - t[k]) <= NEAR].max())
    peak_std = float(np.hypot(own, largest_size(tau_ext, free, len(inside))))
    return Summary(float(tau_ext[k]), peak_std, mean, mean_std, mean * duration, mean_std * duration)


def mean_size(tau_ext: Array, free: Booleans, length: int) -> float:
    """Root mean square of means over `length` samples in free space.

    Where no run of free samples is as long as that, of the longest means that there are; NaN where there are none.
    """
    return _size([_moving_means(run, length) for run, length in _runs(tau_ext, free, length)])


def largest_size(tau_ext: Array, free: Booleans, length: int) -> float:
    """Root mean square of the largest samples of windows of `length` samples in free space, one after the other."""
    windows = (np.array_split(run, max(len(run) // length, 1)) for run, length in _runs(tau_ext, free, length))
    return _size([np.array([np.abs(window).max() for window in of_run]) for of_run in windows])


def _runs(tau_ext: Array, free: Booleans, length: int) -> list[tuple[Array, int]]:
    """The runs of free samples that are as long as that, or the longest where none is, with that length."""
    parts = [tau_ext[run] for run in runs(free)]
    length = min(length, max(map(len, parts), default=0))
    return [(part, length) for part in parts if len(part) >= length > 0]


def _size(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else float("nan")


def _moving_means(x: Array, length: int) -> Array:
    total = np.cumsum(np.concatenate([[0.0], x]))
    return np.asarray((total[length:] - total[:-length]) / length)
