"""Average the repeated periods of a recording, whatever the ratio of its period to its sampling time."""

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.periods.harmonics import Harmonics, are_apart

SMOOTH = 30  # harmonics of the fit that moves samples within the width of one phase bin
ON_PHASE = 1e-6  # of the time between phases: largest distance of a sample on a phase


class Folded(NamedTuple):
    """One mean period on K evenly spaced phases, and the noise of every sample."""

    mean: Array  # (K,)
    var: Array  # (K,) variance of one period, not of the mean
    counts: NDArray[np.int64]  # (K,) samples averaged
    noise: Array  # (N,) sample minus mean


def phases(period: float, rate: float) -> int:
    """Number of phases K of a period: the samples that fit into it, so that no phase stays empty."""
    return int(np.floor(period * rate * (1 + 1e-6)))


def whole_periods(t: Array, period: float, rate: float) -> int:
    """Number of whole periods M of the samples; the last may lack half a sample, since its end is uncertain."""
    return int(np.floor(((t[-1] - t[0]) * rate + 1.5) / (period * rate)))


def end(t: Array, span: slice, period: float, rate: float, M: int | None = None) -> int:
    """Index after the last sample of the first M periods of a span, or of all its whole periods."""
    M = whole_periods(t[span], period, rate) if M is None else M
    after = span.start + np.searchsorted(t[span] - t[span.start], M * period - 0.5 / rate)
    return int(after)


class Phases:
    """The K phases of a period, and the places of samples at times (N,) among them, which all signals of a log share.

    A sample rarely falls on a phase.  A smooth harmonic fit moves it there: only its residual is compared and averaged.
    """

    def __init__(self, t: Array, period: float, K: int) -> None:
        self.t, self.period, self.K = t, period, K

    @cached_property
    def on_them(self) -> bool:
        """Whether each sample falls on the phase after that of the previous sample."""
        return len(self.t) >= self.K and are_apart(self.t, self.period / self.K, ON_PHASE)

    @cached_property
    def bins(self) -> Integers:
        """The phase nearest to each sample, (N,)."""
        return nearest(self.t - self.t[0], self.period, self.K)

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """Number of samples nearest to each phase, (K,)."""
        return np.bincount(self.bins, minlength=self.K)

    @cached_property
    def _smooth(self) -> tuple[Harmonics, Harmonics]:
        """The harmonics of the smooth fit, at the samples and at the phases."""
        omega, harmonics = 2 * np.pi / self.period, min(SMOOTH, self.K // 4)
        times = self.t - self.t[0], np.arange(self.K) / self.K * self.period
        of_samples, of_phases = (Harmonics(since, omega, harmonics) for since in times)
        return of_samples, of_phases

    def move_to_phases(self, x: Array) -> tuple[Array, Array]:
        """Fit samples (N,) smoothly: the fit at the phases (K,), and the residual of each sample (N,)."""
        of_samples, of_phases = self._smooth
        c, residual = of_samples.fit(x)
        return of_phases.evaluate(c), residual

    def fold(self, x: Array) -> Folded:
        """Average the samples (N,) at each phase, from the first sample on.  (6.30), (6.31)

        For a period of a whole number of samples this is plain averaging.  White noise stays white, and a jump of
        friction does not ring as under interpolation.  A phase without samples gets the fit and a count of 0.
        """
        if self.on_them:
            return average_rows(x, self.K)
        smooth, noise = self.move_to_phases(x)
        mean = np.bincount(self.bins, noise, self.K) / np.maximum(self.counts, 1)
        noise -= mean[self.bins]
        var = np.bincount(self.bins, noise * noise, self.K) / np.maximum(self.counts - 1, 1)
        return Folded(mean + smooth, var, self.counts, noise)

    def mean_of(self, x: Array, which: Booleans) -> Array:
        """Average those of the samples (N,) that are `which` (N,) at each phase, (K,).

        A phase without any gets the fit to all samples, of which those that do not count keep it from swinging.
        """
        if which.all():
            return self.fold(x).mean
        smooth, noise = self.move_to_phases(x)
        counts = np.bincount(self.bins[which], minlength=self.K)
        return np.asarray(smooth + np.bincount(self.bins[which], noise[which], self.K) / np.maximum(counts, 1))


def nearest(since: Array, period: float, K: int) -> Integers:
    """The nearest of the K phases of a period to each time (N,) since the first."""
    elapsed_periods = since / period
    elapsed_periods -= np.floor(elapsed_periods)
    elapsed_periods *= K
    bins = np.rint(elapsed_periods, out=elapsed_periods).astype(np.int64)
    bins[bins == K] = 0
    return bins


def average_rows(x: Array, K: int) -> Folded:
    """Average samples (N,) that fall on one phase after the other, so that no fit is needed."""
    M, remainder = divmod(len(x), K)
    whole = M * K
    counts = np.full(K, M)
    counts[:remainder] += 1
    total = x[:whole].reshape(M, K).sum(axis=0)
    total[:remainder] += x[whole:]
    mean = total / np.maximum(counts, 1)
    noise = np.empty_like(x)
    periods = noise[:whole].reshape(M, K)
    np.subtract(x[:whole].reshape(M, K), mean, out=periods)
    np.subtract(x[whole:], mean[:remainder], out=noise[whole:])
    squares = np.einsum("mk,mk->k", periods, periods)
    squares[:remainder] += noise[whole:] ** 2
    return Folded(mean, squares / np.maximum(counts - 1, 1), counts, noise)


def left_out(t: Array, x: Array, period: float, K: int, groups: Integers) -> Iterator[Folded]:
    """Average without each group of samples in turn, `groups` (N,) numbered from 0; `noise` stays empty.

    The smooth fit is to all samples, because it only moves each sample to the nearest phase.
    """
    phased = Phases(t, period, K)
    smooth, residual = phased.move_to_phases(x)
    size = int(groups.max()) + 1
    place = groups * K + phased.bins
    powers = (np.ones_like(residual), residual, residual * residual)
    sums = [np.bincount(place, power, size * K).reshape(size, K) for power in powers]
    totals = [part.sum(axis=0) for part in sums]
    for group in range(size):
        n, total, squares = (whole - part[group] for whole, part in zip(totals, sums, strict=True))
        counts = np.rint(n).astype(np.int64)
        mean = total / np.maximum(counts, 1)
        var = np.maximum(squares - counts * mean**2, 0.0) / np.maximum(counts - 1, 1)
        yield Folded(mean + smooth, var, counts, np.empty(0))


def alternating_mean(folded: Folded, phased: Phases) -> Array:
    """Average the noise with the opposite sign in every other period (K,): noise as in the mean, without the motion.

    Schimmel, The (+-) reference: accuracy of estimated mean components in average response studies, Science 157 (1967).
    """
    period = np.floor((phased.t - phased.t[0]) / phased.period + 0.5 / phased.K).astype(np.int64)
    sums = np.bincount(phased.bins, np.where(period % 2, -folded.noise, folded.noise), phased.K)
    M = int(period[-1]) + 1
    return np.asarray(sums / np.maximum(folded.counts, 1) / np.sqrt(1.0 - M % 2 / M**2))  # an odd one is not balanced


def noise_std(folded: Folded) -> float:
    """Standard deviation of the noise, with one degree of freedom spent per phase.  (6.32), corrected"""
    return float(np.sqrt(folded.noise @ folded.noise / degrees_of_freedom(folded)))


def degrees_of_freedom(folded: Folded) -> int:
    """Degrees of freedom of the noise: all samples less one per phase."""
    return len(folded.noise) - int((folded.counts > 0).sum())
