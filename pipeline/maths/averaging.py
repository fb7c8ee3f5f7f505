"""Averaging the repeated periods of a recording, whatever the ratio of its period to its sampling time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.maths.harmonics import evaluate, project

Array = NDArray[np.float64]

SMOOTH = 30  # harmonics that describe how a signal moves within the width of one phase bin


class Folded(NamedTuple):
    """One period on K evenly spaced phases, and what averaging removed from every sample used."""

    mean: Array  # (K,)
    var: Array  # (K,) variance of one period, not of the mean
    counts: NDArray[np.int64]  # (K,) samples averaged
    noise: Array  # (N,) sample minus mean


def phases(period: float, rate: float) -> int:
    """How many phases a period is divided into, K: as many as it holds whole samples, so that none stays empty."""
    return int(np.floor(period * rate * (1 + 1e-6)))


def whole_periods(t: Array, period: float, rate: float) -> int:
    """How many whole periods the samples cover, M; the last may lack less than half a sample: its end is uncertain."""
    return int(np.floor(((t[-1] - t[0]) * rate + 1.5) / (period * rate)))


def fold(t: Array, x: Array, period: float, K: int, start: float | None = None) -> Folded:
    """Average the samples at each of K phases.

    A sample rarely falls on a phase exactly.  A smooth harmonic fit carries it from where it was taken to the phase,
    and only what the fit leaves is averaged: for a period of a whole number of samples this is plain averaging, the
    noise stays as white as it was, and a jump of friction does not ring as it would under interpolation.  `t`, `x`
    are (N,); a period starts at `start`, or at the first sample.  (6.30), (6.31)
    """
    omega = 2 * np.pi / period
    since = t - (t[0] if start is None else start)
    c = project(since, x, omega, min(SMOOTH, K // 4))
    rest = x - evaluate(c, since, omega)
    bins = np.rint(since / period % 1.0 * K).astype(np.int64) % K
    count = np.bincount(bins, minlength=K)
    mean = np.bincount(bins, rest, K) / count
    away = rest - mean[bins]
    var = np.bincount(bins, away * away, K) / np.maximum(count - 1, 1)
    return Folded(mean + evaluate(c, np.arange(K) / K * period, omega), var, count, away)


def noise_std(folded: Folded) -> float:
    """Standard deviation of the noise, with one degree of freedom spent per phase.  (6.32), corrected"""
    degrees = len(folded.noise) - len(folded.mean)
    return float(np.sqrt(folded.noise @ folded.noise / degrees))
