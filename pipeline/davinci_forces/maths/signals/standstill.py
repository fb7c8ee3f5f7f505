"""Where a joint stands still: friction takes any value up to its Coulomb level there, and no model has its effort."""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.signals.smoothing import segments

HOLD = 1.0  # [s] in which a joint that stands still goes nowhere: longer than a motion takes to turn
STILL = 0.01  # of how far it goes in that time on average
STILL_AT_MOST = 0.05  # where noise makes it seem to move; the slowest turns of an excitation cover twice that
NOISE = 6.0  # standard deviations that noise makes a position range over
# [s] around a reversal that are left out: by then a filter that shows pushes has forgotten it.
BEFORE, AFTER = 0.05, 0.25
SLOW = 0.05  # of the root mean square of the velocity, below which friction may stick


def standing(q: Array, dq: Array, segment: Integers, rate: float, q_std: float = 0.0, spread: int = 0) -> Booleans:
    """Whether a joint stands still at each sample (N,) of its motion, sampled at `rate` [Hz].

    It does throughout every window of `HOLD` in which its position, with noise of `q_std`, ranges over next to nothing,
    and for `spread` samples before and after, which is as far as a low-pass carries its effort.
    """
    usual = float(np.sqrt(np.mean(dq**2))) * HOLD if len(dq) else 0.0
    least = min(max(STILL * usual, NOISE * q_std), STILL_AT_MOST * usual)
    window = round(HOLD * rate) + 1
    parts = [_standing(q[part], window, spread, least) for part in segments(segment)]
    return np.concatenate(parts) if parts else np.zeros(0, np.bool_)


def _standing(q: Array, window: int, spread: int, least: float) -> Booleans:
    """The same of one segment (N,): windows that range over less than `least`, widened by `spread` samples."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    N = len(q)
    if window > N:
        return np.zeros(N, np.bool_)
    whole = slice(window // 2, N - (window - 1) // 2)  # centres of windows within the segment
    first = np.flatnonzero((maximum_filter1d(q, window) - minimum_filter1d(q, window))[whole] < least)
    covers = np.zeros(N + 1, np.int64)
    np.add.at(covers, np.maximum(first - spread, 0), 1)
    np.add.at(covers, np.minimum(first + window + spread, N), -1)
    return np.asarray(np.cumsum(covers[:-1]) > 0)


def moving(dq: Array, T_s: float) -> Booleans:
    """Whether each sample of a velocity (N,), low-passed without delay, is far from any reversal and no standstill."""
    size = float(np.sqrt(np.mean(dq**2)))
    standing = np.abs(dq) <= SLOW * size
    standing[1:] |= np.sign(dq[1:]) != np.sign(dq[:-1])
    since = np.cumsum(np.concatenate([[0], standing]))
    k, N = np.arange(len(dq)), len(dq)
    first, last = np.maximum(k - round(AFTER / T_s), 0), np.minimum(k + round(BEFORE / T_s) + 1, N)
    return np.asarray(since[last] == since[first])
