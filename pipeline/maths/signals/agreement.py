"""Which of the periods of a recording differ from the others by more than their noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.maths.arrays import Array, Integers
from pipeline.maths.signals.averaging import carried, end, phases, whole_periods
from pipeline.maths.signals.period import Period, refine

ODD = 2.0  # times what noise explains: a period that differs by less is left in, as it costs more to lose it
NEGLIGIBLE = 1e-4  # of a signal's standard deviation: a smaller difference is that of an encoder's steps
CHANCE = 1e-3  # that a period differs by as much though nothing but noise differs


class Difference(NamedTuple):
    """How far one period of a signal is from the mean of the others."""

    signal: int
    period: int  # counted from 0
    periods: int
    rms: float  # beyond noise
    ratio: float  # of its root mean square to what noise explains

    @property
    def inside(self) -> bool:
        """Whether periods on either side agree with each other."""
        return 0 < self.period < self.periods - 1


def alike(
    t: Array,
    positions: Sequence[Array],
    signals: Sequence[Array],
    span: slice,
    period: Period,
    rate: float,
    orders: int,
) -> tuple[slice, Period, list[Difference]]:
    """The stretch without the first and last periods that differ from the others, its period, and what differed.

    What does not fill a period is left out at the start rather than at the end, before a period is; of the periods
    never more than half, as they could be the ones that are right.  `t` (N,) [s]; `positions`, whose harmonics give
    the period, and `signals`, which are compared, (N,) each.
    """
    left_out: list[Difference] = []
    fewest = (whole_periods(t[span], period.length, rate) + 1) // 2
    while True:
        M = whole_periods(t[span], period.length, rate)
        used = slice(span.start, end(t, span, period.length, rate))
        odd = [d for i, x in enumerate(signals) for d in differing(t[used], x[used], period.length, rate, i)]
        at_the_edges = sorted((d for d in odd if not d.inside), key=lambda d: -d.ratio)
        if not at_the_edges or fewest >= M:
            return span, period, left_out + sorted(odd, key=lambda d: -d.ratio)[:1]
        left_out.append(at_the_edges[0])
        span = _without(t, span, at_the_edges[0], M, period.length, rate)
        period = refine(t[span], [x[span] for x in positions], period.length, orders)


def _without(t: Array, span: slice, odd: Difference, M: int, length: float, rate: float) -> slice:
    """A stretch of M whole periods without the first or the last of them, or without what does not fill one."""
    if odd.period > 0:
        return slice(span.start, end(t, span, length, rate, M - 1))
    late, next_one = t[span.stop - 1] + 0.5 / rate - M * length, t[span.start] + length - 0.5 / rate
    start = int(np.searchsorted(t, late))
    return slice(start if start > span.start + 1 else int(np.searchsorted(t, next_one)), span.stop)


def alternating(t: Array, x: Array, length: float, rate: float, k: int) -> bool:
    """Whether the periods of a signal (N,) agree with every k-th other but not with those between: k of them are one.

    A motion may all but repeat within its period.  Its periods are compared by groups, in an analysis of variance.
    """
    K = phases(length, rate)
    _, residual, bins = carried(t, x, length, K)
    number = np.floor((t - t[0]) / length + 1e-9).astype(np.int64)
    group = number % k
    counts, sums = _sums(group * K + bins, residual, k, K)
    means = sums / np.maximum(counts, 1)
    noise = residual - means[group, bins]
    degrees = len(x) - int((counts > 0).sum())
    between = counts * (means - sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)) ** 2
    F = float(between.sum()) / ((k - 1) * K) / max(float(noise @ noise) / max(degrees, 1), 1e-300)
    large = float(np.sqrt(between.sum() / len(x))) > NEGLIGIBLE * float(x.std())
    return large and F > ODD**2 and is_unlikely(F, _lag_one(noise), (k - 1) * K, degrees)


def _sums(place: Integers, x: Array, rows: int, K: int) -> tuple[NDArray[np.int64], Array]:
    """How many samples fall on each place, and their sums, (rows, K)."""
    counts: NDArray[np.int64] = np.bincount(place, minlength=rows * K).astype(np.int64)
    return counts.reshape(rows, K), np.asarray(np.bincount(place, x, rows * K).reshape(rows, K), dtype=np.float64)


def _lag_one(noise: Array) -> float:
    """The correlation of each sample with the next, along the last axis."""
    return float(np.sum(noise[..., 1:] * noise[..., :-1]) / max(float(np.sum(noise**2)), 1e-300))


def is_unlikely(F: float, rho: float, own: float, others: float) -> bool:
    """Whether noise of a correlation from sample to sample rarely makes one variance so many times another.

    Squares of first-order noise are correlated by rho^2, so that few of them say as much as independent ones.
    """
    from scipy.stats import f

    worth = (1 - rho**2) / (1 + rho**2)
    return bool(f.sf(F, max(worth * own, 1.0), max(worth * others, 1.0)) < CHANCE)


def differing(t: Array, x: Array, length: float, rate: float, signal: int = 0) -> list[Difference]:
    """The periods of a signal (N,) that differ from the others.

    A period is compared with the mean of the others at each phase, as an analysis of variance would: the mean square of
    the difference over the variance between the others.  Noise that is correlated leaves few degrees of freedom behind
    either, so their number is taken from the others' own correlation.  Of two periods nobody can tell which is odd.
    """
    K = phases(length, rate)
    _, residual, bins = carried(t, x, length, K)
    numbers, number = np.unique(np.floor((t - t[0]) / length + 1e-9), return_inverse=True)
    if len(numbers) < 3:
        return []
    table = _Table.of(residual, bins, number, len(numbers), K)
    odd = np.flatnonzero((table.ratio > ODD) & (table.rms > NEGLIGIBLE * x.std()))
    M = int(numbers[-1]) + 1
    return [
        Difference(signal, int(numbers[m]), M, float(table.rms[m]), float(table.ratio[m]))
        for m in odd.tolist()
        if table.is_unlikely(m)
    ]


class _Table(NamedTuple):
    """Every period's sums at every phase, and what follows from leaving each out."""

    sums: Array  # (M, K)
    counts: NDArray[np.int64]  # (M, K)
    ratio: Array  # (M,) root of the mean square of a period's difference over the variance of the others
    rms: Array  # (M,) of the difference, beyond noise
    degrees: Array  # (M,) of freedom behind the variance of the others

    @classmethod
    def of(cls, residual: Array, bins: Integers, number: Integers, M: int, K: int) -> "_Table":
        place = number * K + bins
        counts, sums = _sums(place, residual, M, K)
        squares = np.bincount(number, residual**2, M).sum()
        others = counts.sum(axis=0) - counts
        both = (counts > 0) & (others > 0)
        apart = np.where(both, sums / np.maximum(counts, 1) - (sums.sum(axis=0) - sums) / np.maximum(others, 1), 0.0)
        weight = np.where(both, counts * others / np.maximum(counts + others, 1), 0.0)
        own = squares_within(residual, place, counts, sums)
        between = squares - float(np.sum(sums.sum(axis=0) ** 2 / np.maximum(counts.sum(axis=0), 1)))
        explained = (weight * apart**2).sum(axis=1)
        # What is left without a period: all squares, less those within it and those it is apart from the others by.
        left = np.maximum(between - explained - own, 0.0)
        degrees = np.maximum(others.sum(axis=1) - (others > 0).sum(axis=1), 1)
        noise = left / degrees
        mean = explained / np.maximum(both.sum(axis=1), 1)
        ratio = np.sqrt(mean / np.maximum(noise, 1e-300))
        return cls(sums, counts, ratio, np.sqrt(np.maximum(mean - noise, 0.0)), degrees)

    def is_unlikely(self, m: int) -> bool:
        """Whether noise as correlated as that of the other periods rarely makes one differ so."""
        others = np.arange(len(self.sums)) != m
        counts, sums = self.counts[others], self.sums[others]
        mean = sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
        noise = np.where(counts > 0, sums / np.maximum(counts, 1) - mean, 0.0)
        return is_unlikely(self.ratio[m] ** 2, _lag_one(noise), self.counts.shape[1], self.degrees[m])


def squares_within(residual: Array, place: Integers, counts: NDArray[np.int64], sums: Array) -> Array:
    """Squares within each period (M,): of samples that share a phase, from their mean."""
    means = (sums / np.maximum(counts, 1)).ravel()
    return np.asarray(np.bincount(place // counts.shape[1], (residual - means[place]) ** 2, len(counts)))
