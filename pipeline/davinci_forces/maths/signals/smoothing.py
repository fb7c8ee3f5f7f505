"""Velocities and accelerations of motion that does not repeat: zero-phase low-pass, then differences."""

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array, Integers, row_blocks

FILTER_ORDER = 4  # of the Butterworth filter, which runs forwards and backwards
NORMAL_MAD = 0.6744897501960817  # median of |x| of a standard normal variable


def lowpass(x: Array, rate: float, cutoff: float) -> Array:
    """Low-pass a signal (N,), or columns (N, ...), without delay.

    At `cutoff` [Hz] each of the two passes halves the power.  A cutoff from 0.4 of the sampling rate on has no effect.
    """
    if cutoff >= 0.4 * rate or len(x) < 2:
        return x
    from scipy.signal import sosfilt

    (sos, steady), pad = _sections(rate, cutoff), min(3 * round(rate / cutoff) + 3, len(x) - 1)
    y = np.concatenate([2 * x[:1] - x[pad:0:-1], x, 2 * x[-1:] - x[-2 : -pad - 2 : -1]])
    for way in (y, y[::-1]):  # as sosfiltfilt, which holds four copies of a long signal at once
        z = steady.reshape(-1, 2, *(1,) * (x.ndim - 1)) * way[0]
        for rows in row_blocks(len(y)):
            way[rows], z = sosfilt(sos, way[rows], axis=0, zi=z)
    return np.asarray(y[pad:-pad])


@cache
def reach(rate: float, cutoff: float) -> int:
    """Number of samples after which the response of `lowpass` has decayed to rounding."""
    if cutoff >= 0.4 * rate:
        return 0
    from scipy.signal import sos2zpk

    largest_pole = float(np.abs(sos2zpk(_sections(rate, cutoff)[0])[1]).max())
    return int(np.ceil(np.log(np.finfo(float).eps) / np.log(largest_pole)))


@cache
def share_passed(rate: float, cutoff: float) -> float:
    """Share of the power of white noise that `lowpass` passes."""
    if cutoff >= 0.4 * rate:
        return 1.0
    from scipy.signal import sosfreqz

    _, H = sosfreqz(_sections(rate, cutoff)[0], 4096)
    return float(np.mean(np.abs(H) ** 4))  # two passes multiply the amplitude by |H| each


@cache
def _sections(rate: float, cutoff: float) -> tuple[Array, Array]:
    """Second-order sections (2, 6) of the filter, and their states (2, 2) after a long input of 1."""
    from scipy.signal import butter, sosfilt_zi

    sos = np.asarray(butter(FILTER_ORDER, cutoff, fs=rate, output="sos"))
    return sos, np.asarray(sosfilt_zi(sos))


def measured_motion(
    q: Array, dq: Array | None, segment: Integers, rate: float, cutoff: float, lag: float = 0.0
) -> tuple[Array, Array, Array]:
    """Low-pass position, velocity and acceleration (N,) of a motion that need not repeat, each segment by itself.

    The velocity is the logged one if there is one.  Differences are central, at the ends one-sided.  The effort is
    measured `lag` [s] later than the motion, so the motion is delayed by `lag`.  Beyond the ends of a segment it goes
    on as it did, so position and velocity agree there, too.
    """
    parts = [_motion(q[part], None if dq is None else dq[part], rate, cutoff, lag) for part in segments(segment)]
    position, velocity, acceleration = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
    return position, velocity, acceleration


def _motion(q: Array, dq: Array | None, rate: float, cutoff: float, lag: float) -> tuple[Array, Array, Array]:
    smooth = lowpass(q, rate, cutoff)
    if len(q) < 2:
        return smooth, np.zeros_like(q), np.zeros_like(q)
    velocity = np.gradient(smooth, 1.0 / rate) if dq is None else lowpass(dq, rate, cutoff)
    acceleration = np.gradient(velocity, 1.0 / rate)
    if lag:  # one spline for all three
        columns = _delay(np.stack([smooth, velocity, acceleration], axis=1), lag * rate)
        smooth, velocity, acceleration = np.ascontiguousarray(columns.T)
    return smooth, velocity, acceleration


def delay_segments(x: Array, segment: Integers, samples: float) -> Array:
    """Delay each segment of a signal (N,) by `samples`; beyond its ends the signal goes on as it did."""
    return np.concatenate([_delay(x[part], samples) for part in segments(segment)]) if samples else x


def _delay(x: Array, samples: float) -> Array:
    """Delay columns (N, ...) by `samples` with a cubic spline; beyond the ends, x(e + s) = 2 x(e) - x(e - s)."""
    from scipy.interpolate import make_interp_spline

    k = np.arange(len(x), dtype=float)
    spline, at, last = make_interp_spline(k, x, k=min(3, len(x) - 1)), k - samples, k[-1]
    inside = np.clip(at, 0.0, last)
    delayed, beyond = np.asarray(spline(inside)), np.flatnonzero(inside != at)
    delayed[beyond] = 2.0 * delayed[beyond] - spline(np.clip(2.0 * inside[beyond] - at[beyond], 0.0, last))
    return delayed


def segments(segment: NDArray[Any]) -> list[slice]:
    """The runs of equal numbers (N,) in order, such as the segments of a signal between gaps."""
    edges = [0, *(np.flatnonzero(segment[1:] != segment[:-1]) + 1).tolist(), len(segment)]
    return [slice(start, stop) for start, stop in pairwise(edges) if stop > start]


def noise_std(residual: Array, segment: Integers, rate: float, cutoff: float) -> float:
    """Standard deviation of the white noise in a residual (N,), from what a low-pass at `cutoff` [Hz] removes.

    The low-pass keeps the model's error but for jumps, which hardly change the median.  0 if it removes nothing.
    """
    return white_std(residual - lowpass_segments(residual, segment, rate, cutoff), share_passed(rate, cutoff))


def white_std(removed: Array, passed: float) -> float:
    """Standard deviation of white noise, from the part (N,) removed by a low-pass that passes a share of its power."""
    if passed >= 1.0:
        return 0.0
    return float(np.median(np.abs(removed), overwrite_input=True) / NORMAL_MAD / np.sqrt(1.0 - passed))


def lowpass_segments(x: Array, segment: Integers, rate: float, cutoff: float) -> Array:
    """Low-pass each segment of a signal (N,), or of columns (N, ...)."""
    return np.concatenate([lowpass(x[part], rate, cutoff) for part in segments(segment)])
