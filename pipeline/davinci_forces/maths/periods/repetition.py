"""Finding where in a recording its motion repeats, and after how long, from the recording itself."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

POINTS = 1024  # that a search is made on, each the mean of neighbouring samples
SHORTEST = 4  # points in a period
DIP = 0.02  # a span repeats where its halves differ by less than this share of twice its variance
MOVES = 0.01  # share of the recording's variance below which a span is at rest
AS_GOOD = 2.0  # times the smallest difference: a lag this good is a period, too
AS_CLEAN = 20.0  # times the smallest difference, and at least `CLEAN`: where a stretch that repeats ends
CLEAN = 2e-3
ROUNDED = 1e-5  # difference that is left of a lag between two points
FINE = 200  # parts of a lag, between which its difference is taken as a parabola
FEW = 4.2  # periods that are searched for a shorter one
AS_LONG = 0.8  # of the longest stretch: one this long counts as long as it
ENOUGH = 0.25  # of a recording: a shorter stretch may repeat by chance


class Repetition(NamedTuple):
    """A stretch of a recording that repeats, and the two periods of it that differ least, all in samples."""

    lag: float  # after which it repeats
    start: int
    stop: int
    core: int  # where the two periods begin


class Lag(NamedTuple):
    """How much the halves of every span of two lags differ, as a share of twice its variance (n - 2 lag + 1,)."""

    lag: int
    difference: Array


def repetition(signals: Sequence[Array]) -> Repetition | None:
    """The longest stretch of a recording in which all signals repeat together, or None where they do not.

    `signals` are (N,) each, without gaps, weighted alike.  Every lag is tried everywhere, on few points; then on a few
    periods of what was found, in case they hold shorter ones.  Where the recording holds so many periods that the means
    of neighbours level them, its parts are searched.  The cost is a few passes over the recording.
    """
    N = len(signals[0])
    x = np.array([(s - s.mean()) / s.std() for s in signals if s.std() > 0]).reshape(-1, N)
    for start, stop in _parts(N):
        found = _searched(x[:, start:stop]) if len(x) else None
        if found is not None:
            return _resolved(x, Repetition(found.lag, found.start + start, found.stop + start, found.core + start))
    return None


def _parts(N: int) -> Iterator[tuple[int, int]]:
    """The whole, then its middle, beginning and end by halves of halves, down to where no means are taken."""
    yield 0, N
    size = N // 2
    while size >= POINTS:
        middle = (N - size) // 2
        yield from ((middle, middle + size), (0, size), (N - size, N))
        size //= 2


def _resolved(x: Array, found: Repetition) -> Repetition:
    """The same stretch with the shortest lag that holds throughout its two best periods."""
    lag, size = found.lag, round(FEW * found.lag)
    middle, best = round(found.core + found.lag), x[:, found.core : found.core + 2 * round(found.lag) + 1]
    while True:
        start = max(min(middle - size // 2, found.stop - size), found.start)
        closer = _searched(x[:, start : min(start + size, found.stop)])
        if closer is not None and closer.lag < 0.75 * lag:
            lag = _shortest([round(closer.lag), round(lag)], best)
        if size <= POINTS:
            return found._replace(lag=lag)
        size = min(size // 4, round(FEW * lag))


def _searched(x: Array) -> Repetition | None:
    """The longest stretch that repeats, on means of neighbouring samples; `x` (J, N)."""
    factor = -(-x.shape[1] // POINTS)
    n = x.shape[1] // factor
    points = x[:, : n * factor].reshape(len(x), n, factor).mean(axis=2)
    lags = {lag.lag: lag for lag in _lags(points)}
    lows = {lag: _lowest(lags, lag) for lag in lags if _is_low(lags, lag)}
    best = min(lows.values(), default=np.inf)
    if best > DIP:
        return None
    good = [lag for lag, value in lows.items() if value <= AS_GOOD * best + ROUNDED]
    runs = {lag: _longest(lags[lag], min(max(AS_CLEAN * lows[lag], 4 * _least(lags[lag]), CLEAN), DIP)) for lag in good}
    longest = max(stop - start for start, stop in runs.values())
    if longest < ENOUGH * n:
        return None
    lag, (start, stop) = next((lag, run) for lag, run in runs.items() if run[1] - run[0] >= AS_LONG * longest)
    core = start + int(lags[lag].difference[start : stop - 2 * lag + 1].argmin())
    exact = _shortest([low for low in lows if low <= lag], points[:, core : core + 2 * lag])
    end = x.shape[1] if stop == n else stop * factor
    return Repetition(exact * factor, start * factor, end, core * factor)


def _shortest(lags: list[int], x: Array) -> float:
    """The shortest of the lags after which two periods (J, n) of the last of them repeat about as well as after it."""
    steps = [max(1, lag // FINE) for lag in lags]
    least = [_vertex(*(_apart(x, lag + d) for d in (-step, 0, step))) for lag, step in zip(lags, steps, strict=True)]
    for lag, step, (shift, value) in zip(lags, steps, least, strict=True):
        if value <= AS_GOOD * least[-1][1] + ROUNDED:
            return lag + step * shift
    raise AssertionError("the last lag is as good as itself")


def _apart(x: Array, lag: int) -> float:
    """How much the signals (J, n) differ after a lag throughout, as a share of twice their variance."""
    return float(((x[:, lag:] - x[:, :-lag]) ** 2).mean() / (2 * x.var(axis=1).mean()))


def _vertex(left: float, middle: float, right: float) -> tuple[float, float]:
    """The lowest point of the parabola through three neighbours: how far from the middle one, and how low.

    No further than the neighbours: beyond them it is noise that says where.
    """
    curvature = left - 2 * middle + right
    if not 0 < curvature < np.inf:
        return 0.0, middle
    shift = float(np.clip(0.5 * (left - right) / curvature, -1.0, 1.0))
    return shift, max(middle + 0.5 * shift * (right - left + curvature * shift), 0.0)


def _lags(x: Array) -> Iterator[Lag]:
    """How much the signals (J, n) differ after each lag, the shortest lag first."""
    n = x.shape[1]
    moves = MOVES * float(x.var(axis=1).sum())
    first, second = (np.concatenate([np.zeros((len(x), 1)), np.cumsum(p, axis=1)], axis=1) for p in (x, x * x))
    squares = second.sum(axis=0)
    for lag in range(SHORTEST, n // 2 + 1):
        span = 2 * lag
        apart = ((x[:, lag:] - x[:, :-lag]) ** 2).sum(axis=0)
        sums = np.concatenate([[0.0], np.cumsum(apart)])
        mean = (first[:, span:] - first[:, :-span]) / span
        variance = (squares[span:] - squares[:-span]) / span - (mean * mean).sum(axis=0)
        difference = (sums[lag:] - sums[:-lag]) / lag
        yield Lag(lag, np.where(variance > moves, difference / (2 * np.maximum(variance, moves)), np.inf))


def _longest(lag: Lag, most: float) -> tuple[int, int]:
    """The longest run of spans that differ by no more: from the first point of it to the end of the last span."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (lag.difference <= most).view(np.int8), [0]])))
    if not len(edges):
        return 0, 0
    at = int((edges[1::2] - edges[::2]).argmax())
    return int(edges[2 * at]), int(edges[2 * at + 1]) - 1 + 2 * lag.lag


def _least(lag: Lag) -> float:
    return float(lag.difference.min())


def _is_low(lags: dict[int, Lag], lag: int) -> bool:
    here = _least(lags[lag])
    return here <= DIP * 2 and all(here <= _least(lags[near]) for near in (lag - 1, lag + 1) if near in lags)


def _lowest(lags: dict[int, Lag], lag: int) -> float:
    """How little the halves of any span differ at the lowest point around a lag, which is between two points."""
    if lag - 1 not in lags or lag + 1 not in lags:
        return _least(lags[lag])
    return _vertex(*(_least(lags[near]) for near in (lag - 1, lag, lag + 1)))[1]
