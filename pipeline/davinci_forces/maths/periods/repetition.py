"""Find where in a recording its motion repeats, and after how long."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, runs
from davinci_forces.maths.periods.harmonics import amplitudes, last_above

POINTS = 1024  # a search reduces a recording to this number of points, each the mean of neighbouring samples
MIN_PERIOD_POINTS = 4  # a period of fewer points is not searched
DIP = 0.02  # a span repeats if its halves differ by less than this share of twice its variance
MIN_SPAN_VARIANCE = 0.01  # a span with a smaller share of the recording's variance is at rest
MAX_RATIO_PERIOD = 2.0  # a lag whose difference is at most this many times the smallest one is a period, too
# A repeating section ends where the difference exceeds this ratio to its smallest value, and this bound.
MAX_RATIO_RUN, MIN_BOUND_RUN = 20.0, 2e-3
ROUNDED = 1e-5  # difference that remains if the period lies between two points
LAG_PARTS = 200  # the difference is taken as a parabola over one of this number of parts of a lag
PERIODS_SEARCHED = 4.2  # a shorter period is searched within this number of periods
MIN_LENGTH_RATIO = 0.8  # a section of at least this share of the longest one is as good as the longest
SAMPLES_PER_TURN = 8  # at least, of the highest harmonic
MIN_RUN_SHARE = 0.25  # a section with a smaller share of a recording may repeat by chance


class Repetition(NamedTuple):
    """A section of a recording that repeats, and its two adjacent periods that differ least; all in samples."""

    lag: float  # after which the section repeats
    start: int
    stop: int
    best_start: int  # first sample of the two periods


def repetition(signals: Sequence[Array]) -> Repetition | None:
    """Find the longest section of a recording in which all signals repeat together, or None.

    `signals` are (N,) each, without gaps, equally weighted.  Every lag is tried on the whole, reduced to few points,
    then on a few periods of the match, which may contain shorter periods.  If a recording has so many periods that the
    means of neighbours cancel them, its parts are searched.  The cost is a few passes over the recording.
    """
    N = len(signals[0])
    x = np.array([(s - s.mean()) / s.std() for s in signals if s.std() > 0]).reshape(-1, N)
    for start, stop in _parts(N):
        match = _search(x[:, start:stop]) if len(x) else None
        if match is not None:
            return _shorten(x, Repetition(match.lag, match.start + start, match.stop + start, match.best_start + start))
    return None


def harmonics_of(signals: Sequence[Array], repeat: Repetition, least: int) -> int:
    """The number of harmonics, at least `least`, in a period of any of the signals (N,); fewer would leave noise."""
    one = slice(repeat.best_start, repeat.best_start + round(repeat.lag))
    highest = max((last_above(amplitudes(x[one])) for x in signals), default=0)
    return max(least, min(highest, int(repeat.lag / SAMPLES_PER_TURN)))


def _parts(N: int) -> Iterator[tuple[int, int]]:
    """Yield the whole, then its middle, beginning and end of half the length, of a quarter, and so on to `POINTS`."""
    yield 0, N
    size = N // 2
    while size >= POINTS:
        middle = (N - size) // 2
        yield from ((middle, middle + size), (0, size), (N - size, N))
        size //= 2


def _shorten(x: Array, match: Repetition) -> Repetition:
    """Replace the lag of a section by the shortest lag after which its two best periods repeat."""
    lag, size, middle = match.lag, round(PERIODS_SEARCHED * match.lag), round(match.best_start + match.lag)
    best = x[:, match.best_start : match.best_start + 2 * round(match.lag) + 1]
    while True:
        start = max(min(middle - size // 2, match.stop - size), match.start)
        shorter = _search(x[:, start : min(start + size, match.stop)])
        if shorter is not None and shorter.lag < 0.75 * lag:
            lag = _shortest([round(shorter.lag), round(lag)], best)
        if size <= POINTS:
            return match._replace(lag=lag)
        size = min(size // 4, round(PERIODS_SEARCHED * lag))


def _search(x: Array) -> Repetition | None:
    """Find the longest section of signals `x` (J, N) that repeats, on means of neighbouring samples."""
    factor = -(-x.shape[1] // POINTS)
    n = x.shape[1] // factor
    points = x[:, : n * factor].reshape(len(x), n, factor).mean(axis=2)
    differences = dict(_differences(points))
    least = {lag: float(difference.min()) for lag, difference in differences.items()}
    around = {lag: (least.get(lag - 1, np.inf), value, least.get(lag + 1, np.inf)) for lag, value in least.items()}
    lows = {lag: vertex(*near)[1] for lag, near in around.items() if near[1] == min(near) and near[1] <= 2 * DIP}
    best = min(lows.values(), default=np.inf)
    if best > DIP:
        return None
    good = [lag for lag, value in lows.items() if value <= MAX_RATIO_PERIOD * best + ROUNDED]
    bounds = {lag: max(MAX_RATIO_RUN * lows[lag], 4 * least[lag], MIN_BOUND_RUN) for lag in good}
    spans = {lag: _longest(differences[lag], lag, min(bound, DIP)) for lag, bound in bounds.items()}
    longest = max(stop - start for start, stop in spans.values())
    if longest < MIN_RUN_SHARE * n:
        return None
    lag = next(lag for lag, (start, stop) in spans.items() if stop - start >= MIN_LENGTH_RATIO * longest)
    start, stop = spans[lag]
    core = start + int(differences[lag][start : stop - 2 * lag + 1].argmin())
    exact = _shortest([low for low in lows if low <= lag], points[:, core : core + 2 * lag])
    end = x.shape[1] if stop == n else stop * factor
    return Repetition(exact * factor, start * factor, end, core * factor)


def _shortest(lags: list[int], x: Array) -> float:
    """The shortest lag after which `x` (J, n), two periods of the last lag, repeats about as well as after that lag."""
    steps = [max(1, lag // LAG_PARTS) for lag in lags]
    least = [vertex(*(_apart(x, lag + d) for d in (-step, 0, step))) for lag, step in zip(lags, steps, strict=True)]
    bound = MAX_RATIO_PERIOD * least[-1][1] + ROUNDED
    candidates = zip(lags, steps, least, strict=True)
    return next(lag + step * shift for lag, step, (shift, value) in candidates if value <= bound)


def _apart(x: Array, lag: int) -> float:
    """Mean squared difference of the signals (J, n) after a lag, as a share of twice their variance."""
    return float(((x[:, lag:] - x[:, :-lag]) ** 2).mean() / (2 * x.var(axis=1).mean()))


def vertex(before: float, middle: float, after: float) -> tuple[float, float]:
    """Lowest point of the parabola through three neighbours, not beyond: its place from the middle, and its value."""
    curvature = before - 2 * middle + after
    if not 0 < curvature < np.inf:
        return 0.0, middle
    shift = float(np.clip(0.5 * (before - after) / curvature, -1.0, 1.0))
    return shift, max(middle + 0.5 * shift * (after - before + curvature * shift), 0.0)


def _differences(x: Array) -> Iterator[tuple[int, Array]]:
    """Yield the differences of the signals (J, n) after each lag, the shortest lag first.

    Differences (n - 2 lag + 1,) are those between the halves of each span of two lags, over twice its variance.
    """
    n = x.shape[1]
    moves = MIN_SPAN_VARIANCE * float(x.var(axis=1).sum())
    first, second = (np.concatenate([np.zeros((len(x), 1)), np.cumsum(p, axis=1)], axis=1) for p in (x, x * x))
    squares = second.sum(axis=0)
    for lag in range(MIN_PERIOD_POINTS, n // 2 + 1):
        span = 2 * lag
        apart = ((x[:, lag:] - x[:, :-lag]) ** 2).sum(axis=0)
        sums = np.concatenate([[0.0], np.cumsum(apart)])
        mean = (first[:, span:] - first[:, :-span]) / span
        variance = (squares[span:] - squares[:-span]) / span - (mean * mean).sum(axis=0)
        difference = (sums[lag:] - sums[:-lag]) / lag
        yield lag, np.where(variance > moves, difference / (2 * np.maximum(variance, moves)), np.inf)


def _longest(difference: Array, lag: int, most: float) -> tuple[int, int]:
    """The longest run of spans that differ by at most `most`: from its first point to the end of its last span."""
    run = max(runs(difference <= most), key=lambda run: run.stop - run.start, default=None)
    return (run.start, run.stop - 1 + 2 * lag) if run else (0, 0)
