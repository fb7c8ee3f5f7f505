"""Find the periods of a recording that differ from the others by more than their noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, runs
from davinci_forces.maths.periods.averaging import Phases, end, nearest, phases, whole_periods
from davinci_forces.maths.periods.harmonics import Harmonics
from davinci_forces.maths.periods.period import refine, standard_error

MIN_ODD_RATIO = 2.0  # of a difference to what noise explains: dropping a period costs more than a smaller one
NEGLIGIBLE_DIFFERENCE = 1e-4  # share of a signal's standard deviation: encoder steps cause smaller ones
ODD_PROBABILITY = 1e-3  # a period differs if noise explains its difference with a smaller probability
STRAY_FACTOR = 4.0  # a sample strays if it is this many residuals of the repeating motion away
MIN_STRAY = 0.01  # share of the motion's standard deviation: a nearer sample does not stray
IN_A_ROW = 3  # straying samples that end a repeated motion: a single one is a glitch
UNSURE = 0.02  # largest uncertainty of the phase after a gap, as a share of a period


class Difference(NamedTuple):
    """Difference of one period of a signal from the mean of the others."""

    signal: int
    period: int  # counted from 0
    periods: int
    start: float  # [s] of the period
    ratio: float  # root mean square of the difference over what noise explains

    @property
    def has_periods_on_both_sides(self) -> bool:
        """Whether the period lies between others, which agree with each other."""
        return 0 < self.period < self.periods - 1


def agreeing_stretch(
    t: Array, positions: Sequence[Array], signals: Sequence[Array], span: slice, length: float, rate: float, H: int
) -> tuple[slice, float, list[Difference]]:
    """Leave out the first and last periods that differ from the others; return the span, period, differences.

    At the start, an incomplete period is left out before a whole one.  At most half of the periods are left out, since
    those could be the correct ones.  `t` (N,) and `length` are in seconds.  H harmonics of `positions` give the period,
    and `signals` are compared, (N,) each.
    """
    left_out: list[Difference] = []
    min_periods = (whole_periods(t[span], length, rate) + 1) // 2
    while True:
        M = whole_periods(t[span], length, rate)
        used = slice(span.start, end(t, span, length, rate))
        odd = differing_periods(t[used], [x[used] for x in signals], length, rate)
        at_the_edges = sorted((d for d in odd if not d.has_periods_on_both_sides), key=lambda d: -d.ratio)
        if not at_the_edges or min_periods >= M:
            return span, length, left_out + sorted(odd, key=lambda d: -d.ratio)[:1]
        left_out.append(at_the_edges[0])
        span = _shorten(t, span, at_the_edges[0], M, length, rate)
        length = refine(t[span], [x[span] for x in positions], length, H)


def _shorten(t: Array, span: slice, odd: Difference, M: int, length: float, rate: float) -> slice:
    """Shorten a span of M whole periods by its first or last period, or by an incomplete period at its start."""
    if odd.period > 0:
        return slice(span.start, end(t, span, length, rate, M - 1))
    late, next_one = t[span.stop - 1] + 0.5 / rate - M * length, t[span.start] + length - 0.5 / rate
    start = int(np.searchsorted(t, late))
    return slice(start if start > span.start + 1 else int(np.searchsorted(t, next_one)), span.stop)


def multiple_of_period(t: Array, signals: Sequence[Array], length: float, rate: float, among: Sequence[int]) -> int:
    """The number k, the first of `among`, for which signals (N,) repeat only after k of these periods, or 1.

    A motion may nearly repeat within its period: then only every k-th period agrees, by an analysis of variance.
    """
    phased, number = Phases(t, length, phases(length, rate)), repetitions(t, length)
    residuals = [phased.move_to_phases(x)[1] for x in signals if among]
    for k in among:
        place = number % k * phased.K + phased.bins
        counts = np.bincount(place, minlength=k * phased.K).reshape(k, -1)
        if any(_alternates(x, residual, place, counts) for x, residual in zip(signals, residuals, strict=True)):
            return k
    return 1


def _alternates(x: Array, residual: Array, place: Integers, counts: Integers) -> bool:
    """Whether groups of the periods of a signal (N,) differ by more than noise; `counts` (k, K) are their samples."""
    sums = _sums(place, residual, counts)
    means = sums / np.maximum(counts, 1)
    mean = sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
    between, freedom = float(np.sum(counts * (means - mean) ** 2)), counts[1:].size
    within, degrees = float(residual @ residual - np.sum(sums * means)), len(x) - int((counts > 0).sum())
    F = between / freedom / max(within / max(degrees, 1), 1e-300)
    if F <= MIN_ODD_RATIO**2 or np.sqrt(between / len(x)) <= NEGLIGIBLE_DIFFERENCE * x.std():
        return False
    return is_unlikely(F, _lag_one(residual - means.ravel()[place]), freedom, degrees)


def repetitions(t: Array, length: float) -> Integers:
    """Number of the period of each time (N,), 0 for the first time."""
    elapsed_periods: Array = (t - t[0]) / length + 1e-9
    return elapsed_periods.astype(np.int64)


def _sums(place: Integers, x: Array, counts: Integers) -> Array:
    """Sum samples (N,) by their place in a table of the shape of their counts."""
    return np.asarray(np.bincount(place, x, counts.size).reshape(counts.shape), dtype=np.float64)


def _lag_one(noise: Array) -> float:
    """Correlation of each sample with the next, along the last axis."""
    return float(np.sum(noise[..., 1:] * noise[..., :-1]) / max(float(np.sum(noise**2)), 1e-300))


def is_unlikely(F: float, rho: float, degrees: float, degrees_others: float) -> bool:
    """Whether noise with correlation `rho` from sample to sample rarely gives so large a ratio F of two variances.

    Squares of first-order noise are correlated by rho^2, so they are worth fewer independent squares.
    """
    from scipy.special import fdtrc

    information = (1 - rho**2) / (1 + rho**2)
    return bool(fdtrc(max(information * degrees, 1.0), max(information * degrees_others, 1.0), F) < ODD_PROBABILITY)


def differing_periods(t: Array, signals: Sequence[Array], length: float, rate: float) -> list[Difference]:
    """Find the periods of signals (N,) that differ from the others; none of fewer than three periods.

    A period is compared with the mean of the others at each phase, as in an analysis of variance.  The statistic is the
    mean square of the difference over the variance between the others.  Correlated noise reduces the degrees of
    freedom of both squares, by a factor that follows from the correlation of the other periods.
    """
    phased, number = Phases(t, length, phases(length, rate)), repetitions(t, length)
    first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1])  # sample of each of M periods that hold samples
    M, K = len(first), phased.K
    if M < 3:
        return []
    place = np.repeat(np.arange(M) * K, np.diff(first, append=len(t))) + nearest(t - t[0], length, K)
    counts = np.bincount(place, minlength=M * K).reshape(M, K)
    totals = counts.sum(axis=0)
    others = totals - counts
    pairs = counts * others  # 0 if a period or the others have no samples at a phase
    weight = np.divide(totals, pairs, out=np.zeros(pairs.shape), where=pairs > 0)
    degrees = np.maximum(others.sum(axis=1) - np.count_nonzero(others, axis=1), 1)  # behind the variance of the others
    differences = list[Difference]()
    for signal, x in enumerate(signals):
        _, residual = phased.move_to_phases(x)
        sums = _sums(place, residual, counts)
        mean = sums.sum(axis=0) / np.maximum(totals, 1)
        deviation = sums - counts * mean
        explained = np.einsum("mk,mk,mk->m", deviation, deviation, weight)
        # Squares between the other periods: all squares less the squares within this period and of its difference.
        squares = np.add.reduceat(residual * residual, first)
        within = squares - np.einsum("mk,mk->m", sums, sums / np.maximum(counts, 1))
        between = squares.sum() - mean @ sums.sum(axis=0)
        noise = np.maximum(between - explained - within, 0.0) / degrees
        difference = explained / np.maximum((pairs > 0).sum(axis=1), 1)
        ratio, rms = np.sqrt(difference / np.maximum(noise, 1e-300)), np.sqrt(np.maximum(difference - noise, 0.0))
        for m in np.flatnonzero((ratio > MIN_ODD_RATIO) & (rms > NEGLIGIBLE_DIFFERENCE * x.std())).tolist():
            rho = _lag_one_of_others(np.delete(sums, m, axis=0), np.delete(counts, m, axis=0))
            if is_unlikely(float(ratio[m]) ** 2, rho, K, degrees[m]):
                period, periods = int(number[first[m]]), int(number[-1]) + 1
                start = float(t[0]) + period * length
                differences.append(Difference(signal, period, periods, start, float(ratio[m])))
    return differences


def _lag_one_of_others(sums: Array, counts: Integers) -> float:
    """Correlation of the noise of periods from phase to phase, from sums and numbers of samples (M, K)."""
    mean = sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
    return _lag_one(np.where(counts > 0, sums / np.maximum(counts, 1) - mean, 0.0))


def stretch(t: Array, signals: Sequence[Array], length: float, agreed: slice, harmonics: int) -> tuple[slice, float]:
    """Extend the repeating samples `agreed` to the longest run that repeats with one period; refine that period [s].

    The harmonics of `agreed` predict up to as many samples again on either side.  Samples that agree are added, and the
    period is fitted again.  `t` (N,) [s], with or without gaps; `signals` (N,) each; `length` [s] precise
    enough for its first few periods.
    """
    length = refine(t[agreed], [x[agreed] for x in signals], length, harmonics)
    while (wide := _certain(t, signals, length, agreed, harmonics)) != agreed:
        strays = _strays(t, signals, length, agreed, wide, harmonics)
        ahead = _ahead(strays[agreed.stop - wide.start :])
        behind = _ahead(strays[: agreed.start - wide.start][::-1])
        longer = slice(agreed.start - behind, agreed.stop + ahead)
        if longer == agreed:
            break
        agreed = longer
        length = refine(t[agreed], [x[agreed] for x in signals], length, harmonics)
    return agreed, length


def _certain(t: Array, signals: Sequence[Array], length: float, agreed: slice, harmonics: int) -> slice:
    """`agreed` and as many samples on either side, up to the first gap after which the phase is not known."""
    reach = agreed.stop - agreed.start
    wide = slice(max(agreed.start - reach, 0), min(agreed.stop + reach, len(t)))
    steps = np.diff(t[wide])
    # The error of a period is less than the period, so a shorter gap cannot matter.
    if not np.any(steps > UNSURE * length):
        return wide
    std = standard_error(t[agreed], [x[agreed] for x in signals], length, harmonics)
    far = wide.start + 1 + np.flatnonzero(steps * std > UNSURE * length**2)
    before, after = far[far <= agreed.start], far[far >= agreed.stop]
    return slice(int(before[-1]) if len(before) else wide.start, int(after[0]) if len(after) else wide.stop)


def _strays(t: Array, signals: Sequence[Array], length: float, agreed: slice, wide: slice, harmonics: int) -> Booleans:
    """Whether any signal differs from its mean period in `agreed` by more than its scatter, per sample of `wide`."""
    omega, since = 2 * np.pi / length, t[wide] - t[agreed.start]
    inside = slice(agreed.start - wide.start, agreed.stop - wide.start)
    N, rate = agreed.stop - agreed.start, (agreed.stop - agreed.start - 1) / (t[agreed.stop - 1] - t[agreed.start])
    K = phases(length, rate)
    bins = nearest(since, length, K)
    agreed_fit, wide_fit = (Harmonics(times, omega, harmonics) for times in (since[inside], since))
    counts = np.maximum(np.bincount(bins[inside], minlength=K), 1)
    strays = np.zeros(len(since), dtype=bool)
    for x in signals:
        residual = wide_fit.evaluate(agreed_fit.project(x[agreed]))
        np.subtract(x[wide], residual, out=residual)
        residual -= (np.bincount(bins[inside], residual[inside], K) / counts)[bins]
        # The mean of M periods contains their noise, so samples of other periods differ more from this mean.
        expected = np.sqrt(residual[inside] @ residual[inside] / max(N - K, 1) * (1 + K / N))
        strays |= np.abs(residual) > max(STRAY_FACTOR * expected, MIN_STRAY * x[agreed].std())
    return strays


def _ahead(strays: Booleans) -> int:
    """Number of samples before the first run of samples that stray."""
    return next((run.start for run in runs(strays) if run.stop - run.start >= IN_A_ROW), len(strays))
