"""Samples at which a joint stands still.  No model predicts its friction, which is anything up to the static level."""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.signals.smoothing import NORMAL_MAD, segments

HOLD = 1.0  # [s] shortest standstill: longer than a motion takes to reverse
STILL = 0.01  # a joint stands still below this share of its mean travel in `HOLD`
STILL_AT_MOST = 0.05  # largest such share with noise; the slowest reversals of an excitation travel twice as far
NOISE = 6.0  # range of a resting position, in standard deviations of its noise
# [s] left out around a reversal: after `AFTER`, the effect of the reversal on a filter has decayed.
BEFORE, AFTER = 0.05, 0.25
FASTEST = 99.0  # [%] of samples are slower than the speed of a motion, so that an outlier is none
SLOW = 0.05  # friction may stick below this share of the root mean square of the velocity


def is_standing_still(
    q: Array, dq: Array, segment: Integers, rate: float, q_std: float = 0.0, spread: int = 0
) -> Booleans:
    """Whether a joint stands still at each sample (N,) of its motion, sampled at `rate` [Hz].

    It stands still throughout every window of `HOLD` in which its position, with noise of `q_std`, hardly changes.  The
    `spread` samples before and after are part of the standstill: a low-pass spreads its effort over them.
    """
    least, window = least_travel(dq, q_std), round(HOLD * rate) + 1
    parts = [_standing(q[part], window, spread, least) for part in segments(segment)]
    return np.concatenate(parts) if parts else np.zeros(0, np.bool_)


def speed_of(dq: Array) -> float:
    """The speed of a motion with velocity (N,): its largest, but for outliers."""
    return float(np.percentile(np.abs(dq), FASTEST))


def least_travel(dq: Array, q_std: float) -> float:
    """Travel in `HOLD`, below which a joint with velocity (N,) stands still, if its position has noise of `q_std`."""
    usual_travel = float(np.sqrt(np.mean(dq**2))) * HOLD if len(dq) else 0.0
    return min(max(STILL * usual_travel, NOISE * q_std), STILL_AT_MOST * usual_travel)


def _standing(q: Array, window: int, spread: int, least: float) -> Booleans:
    """Standstill of one segment (N,): windows whose range is below `least`, widened by `spread` samples."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    N = len(q)
    if window > N:
        return np.zeros(N, np.bool_)
    centres = slice(window // 2, N - (window - 1) // 2)  # of windows within the segment
    still = np.zeros(N, np.bool_)
    still[centres] = (maximum_filter1d(q, window) - minimum_filter1d(q, window))[centres] < least
    shift = window % 2 - 1  # an even window has one more sample before its centre than after it
    return np.asarray(maximum_filter1d(still, window + 2 * spread, mode="constant", origin=shift))


def without_doubtful_signs(dq: Array, standing: Booleans, q_std: float, dq_std: float) -> Array:
    """A low-passed velocity (N,), and 0 where its sign, and with it that of friction, is not known.

    It is not known at standstill, but for the ends of its `spread`.  It is not known either where the expected sign of
    the filter, erf(|dq| / (sqrt(2) dq_std)), is below 1/2, so nearer to 0 than to a sign.  `q_std` and `dq_std` are
    the deviations of the noise.
    """
    rests = standing & (np.abs(dq) <= max(least_travel(dq, q_std) / HOLD, NOISE * dq_std))
    return np.where(rests | (np.abs(dq) < NORMAL_MAD * dq_std), 0.0, dq)


def is_far_from_reversals(dq: Array, T_s: float) -> Booleans:
    """Whether each sample of a velocity (N,), low-passed without delay, is far from reversals and standstills."""
    from scipy.ndimage import maximum_filter1d

    rms_velocity = float(np.sqrt(np.mean(dq**2)))
    standing = np.abs(dq) <= SLOW * rms_velocity
    standing[1:] |= np.sign(dq[1:]) != np.sign(dq[:-1])
    before, after = round(BEFORE / T_s), round(AFTER / T_s)
    size = before + after + 1
    return np.asarray(~maximum_filter1d(standing, size, mode="constant", origin=after - size // 2))
