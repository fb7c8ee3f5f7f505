"""Averaging the repeated periods of a recording, whatever the ratio of its period to its sampling time."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.maths.arrays import Array, Integers
from pipeline.maths.signals.harmonics import are_apart, evaluate, project

SMOOTH = 30  # harmonics that describe how a signal moves within the width of one phase bin
ON_PHASE = 1e-6  # of the time between phases, by which a sample on one may be off it


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


def end(t: Array, span: slice, period: float, rate: float, M: int | None = None) -> int:
    """The sample after the last of the first M periods of a stretch; of all the whole ones that it covers."""
    M = whole_periods(t[span], period, rate) if M is None else M
    after = span.start + np.searchsorted(t[span] - t[span.start], M * period - 0.5 / rate)
    return int(after)


def fold(t: Array, x: Array, period: float, K: int) -> Folded:
    """Average the samples at each of K phases, from the first sample on.

    A sample rarely falls on a phase exactly.  A smooth harmonic fit carries it from where it was taken to the phase,
    and only what the fit leaves is averaged: for a period of a whole number of samples this is plain averaging, the
    noise stays as white as it was, and a jump of friction does not ring as it would under interpolation.  A phase that
    no sample falls on takes the fit and a count of 0.  `t`, `x` are (N,).  (6.30), (6.31)
    """
    if len(t) >= K and on_phases(t, period, K):
        return stacked(x, K)
    smooth, residual, bins = carried(t, x, period, K)
    counts = np.bincount(bins, minlength=K)
    mean = np.bincount(bins, residual, K) / np.maximum(counts, 1)
    noise = residual - mean[bins]
    var = np.bincount(bins, noise * noise, K) / np.maximum(counts - 1, 1)
    return Folded(mean + smooth, var, counts, noise)


def on_phases(t: Array, period: float, K: int) -> bool:
    """Whether each sample falls on the phase after that of the one before it."""
    return are_apart(t, period / K, ON_PHASE)


def stacked(x: Array, K: int) -> Folded:
    """The average of samples each of which falls on the next phase, which needs no fit.  `x` is (N,)."""
    M, rest = divmod(len(x), K)
    whole = M * K
    counts = np.full(K, M)
    counts[:rest] += 1
    total = x[:whole].reshape(M, K).sum(axis=0)
    total[:rest] += x[whole:]
    mean = total / np.maximum(counts, 1)
    noise = np.empty_like(x)
    periods = noise[:whole].reshape(M, K)
    np.subtract(x[:whole].reshape(M, K), mean, out=periods)
    np.subtract(x[whole:], mean[:rest], out=noise[whole:])
    squares = np.einsum("mk,mk->k", periods, periods)
    squares[:rest] += noise[whole:] ** 2
    return Folded(mean, squares / np.maximum(counts - 1, 1), counts, noise)


def left_out(t: Array, x: Array, period: float, K: int, groups: Integers) -> Iterator[Folded]:
    """The average without each group of samples in turn, `groups` (N,) numbered from 0; `noise` stays empty.

    The smooth fit is that of all samples: it only carries each to the nearest phase.
    """
    smooth, residual, bins = carried(t, x, period, K)
    size = int(groups.max()) + 1
    place = groups * K + bins
    powers = (np.ones_like(residual), residual, residual * residual)
    sums = [np.bincount(place, w, size * K).reshape(size, K) for w in powers]
    totals = [part.sum(axis=0) for part in sums]
    for group in range(size):
        n, total, squares = (whole - part[group] for whole, part in zip(totals, sums, strict=True))
        counts = np.rint(n).astype(np.int64)
        mean = total / np.maximum(counts, 1)
        var = np.maximum(squares - counts * mean**2, 0.0) / np.maximum(counts - 1, 1)
        yield Folded(mean + smooth, var, counts, np.empty(0))


def carried(t: Array, x: Array, period: float, K: int) -> tuple[Array, Array, Integers]:
    """The smooth fit at the phases (K,), what it leaves of each sample (N,), and the phase of each sample (N,)."""
    omega, since = 2 * np.pi / period, t - t[0]
    c = project(since, x, omega, min(SMOOTH, K // 4))
    bins = np.rint(since / period % 1.0 * K).astype(np.int64) % K
    return evaluate(c, np.arange(K) / K * period, omega), x - evaluate(c, since, omega), bins


def noise_std(folded: Folded) -> float:
    """Standard deviation of the noise, with one degree of freedom spent per phase.  (6.32), corrected"""
    return float(np.sqrt(folded.noise @ folded.noise / degrees(folded)))


def degrees(folded: Folded) -> int:
    """Degrees of freedom of the noise: one is spent per phase."""
    return len(folded.noise) - int((folded.counts > 0).sum())
