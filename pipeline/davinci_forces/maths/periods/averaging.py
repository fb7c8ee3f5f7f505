"""Averaging the repeated periods of a recording, whatever the ratio of its period to its sampling time."""

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.periods.harmonics import Harmonics, are_apart

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


class Phases:
    """The K phases of a period, and where samples (N,) at times (N,) fall among them: what all signals of a log share.

    A sample rarely falls on a phase exactly.  A smooth harmonic fit carries it from where it was taken to the phase,
    and only what the fit leaves is compared and averaged.
    """

    def __init__(self, t: Array, period: float, K: int) -> None:
        self.t, self.period, self.K = t, period, K

    @cached_property
    def on_them(self) -> bool:
        """Whether each sample falls on the phase after that of the one before it."""
        return len(self.t) >= self.K and on_phases(self.t, self.period, self.K)

    @cached_property
    def bins(self) -> Integers:
        """The phase that is nearest to each sample, (N,)."""
        return nearest(self.t - self.t[0], self.period, self.K)

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """How many samples are nearest to each phase, (K,)."""
        return np.bincount(self.bins, minlength=self.K)

    @cached_property
    def _smooth(self) -> tuple[Harmonics, Harmonics]:
        """The harmonics that describe a signal, at its samples and at the phases."""
        omega, harmonics = 2 * np.pi / self.period, min(SMOOTH, self.K // 4)
        times = self.t - self.t[0], np.arange(self.K) / self.K * self.period
        of_samples, of_phases = (Harmonics(since, omega, harmonics) for since in times)
        return of_samples, of_phases

    def carried(self, x: Array) -> tuple[Array, Array]:
        """The smooth fit of samples (N,) at the phases (K,), and what it leaves of each sample (N,)."""
        of_samples, of_phases = self._smooth
        c, residual = of_samples.left(x)
        return of_phases.evaluate(c), residual

    def fold(self, x: Array) -> Folded:
        """Average the samples (N,) at each phase, from the first sample on.

        For a period of a whole number of samples this is plain averaging, the noise stays as white as it was, and a
        jump of friction does not ring as it would under interpolation.  A phase that no sample falls on takes the fit
        and a count of 0.  (6.30), (6.31)
        """
        if self.on_them:
            return stacked(x, self.K)
        smooth, noise = self.carried(x)
        mean = np.bincount(self.bins, noise, self.K) / np.maximum(self.counts, 1)
        noise -= mean[self.bins]
        var = np.bincount(self.bins, noise * noise, self.K) / np.maximum(self.counts - 1, 1)
        return Folded(mean + smooth, var, self.counts, noise)


def nearest(since: Array, period: float, K: int) -> Integers:
    """The nearest of K phases of a period to each time (N,) since its first."""
    turns = since / period
    turns -= np.floor(turns)
    turns *= K
    bins = np.rint(turns, out=turns).astype(np.int64)
    bins[bins == K] = 0
    return bins


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
    phased = Phases(t, period, K)
    smooth, residual = phased.carried(x)
    size = int(groups.max()) + 1
    place = groups * K + phased.bins
    powers = (np.ones_like(residual), residual, residual * residual)
    sums = [np.bincount(place, w, size * K).reshape(size, K) for w in powers]
    totals = [part.sum(axis=0) for part in sums]
    for group in range(size):
        n, total, squares = (whole - part[group] for whole, part in zip(totals, sums, strict=True))
        counts = np.rint(n).astype(np.int64)
        mean = total / np.maximum(counts, 1)
        var = np.maximum(squares - counts * mean**2, 0.0) / np.maximum(counts - 1, 1)
        yield Folded(mean + smooth, var, counts, np.empty(0))


def noise_std(folded: Folded) -> float:
    """Standard deviation of the noise, with one degree of freedom spent per phase.  (6.32), corrected"""
    return float(np.sqrt(folded.noise @ folded.noise / degrees(folded)))


def degrees(folded: Folded) -> int:
    """Degrees of freedom of the noise: one is spent per phase."""
    return len(folded.noise) - int((folded.counts > 0).sum())
