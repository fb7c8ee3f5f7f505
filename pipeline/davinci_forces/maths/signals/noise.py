"""How much of a signal is white noise."""

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.signals.smoothing import lowpass, segments, share_passed

NORMAL_MAD = 0.6744897501960817  # median of |x| of a standard normal variable


def noise_std(residual: Array, segment: Integers, rate: float, cutoff: float) -> float:
    """Standard deviation of the white noise in a residual (N,), from what a low-pass at `cutoff` [Hz] takes out of it.

    The model's error is slower than that but for jumps where the motion turns, so the median is taken, which a few
    jumps do not move.  0 where the sampling rate leaves the low-pass nothing to take out.
    """
    return white_std(residual - smoothed(residual, segment, rate, cutoff), share_passed(rate, cutoff))


def white_std(removed: Array, passed: float) -> float:
    """Standard deviation of white noise, from what a low-pass that lets a share of its power through took out (N,)."""
    return float(np.median(np.abs(removed)) / NORMAL_MAD / np.sqrt(1.0 - passed)) if passed < 1.0 else 0.0


def smoothed(x: Array, segment: Integers, rate: float, cutoff: float) -> Array:
    """The low-pass of each segment of a signal (N,), or of columns (N, ...)."""
    return np.concatenate([lowpass(x[part], rate, cutoff) for part in segments(segment)])
