"""Statistics of a log's clock, computed block by block, and interpolation between its samples.

`cubic` fills up to `FILLED` of missing samples, so that filters pass, and never bridges a longer gap.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, runs

GAP = 2.5  # sampling times: a longer interval is an interruption, unless at most `FILLED` is missing
MISSING = 1.5  # sampling times: a longer interval lacks a sample
FILLED = 0.02  # [s] longest time without samples that is interpolated: a third of a period at the usual low-pass, 17 Hz
ALIKE = 0.25  # of an interval: largest difference to the next one in an even stretch
MIN_INTERVALS_EVEN = 10  # an even stretch at another rate has at least so many intervals
MAX_PERIOD_RATIO = 10.0  # a sampling time over the usual one; slower samples are not interpolated
MAX_REPEATED, MAX_JITTER = 0.1, 0.1  # share of rows, and of the sampling time, above which a remark says so
MIN_SHARE_RHYTHM = 0.9  # of the times without samples, in a column that is sampled in a rhythm of its own
TIME_ROUNDING = 1e-6  # relative, of times


@dataclass
class ClockStatistics:
    """Running statistics of a clock and of the rows of its log.  Times in seconds; rows are counted from 0."""

    samples: int = 0
    first: float = math.nan
    last: float = math.nan
    backward: int = 0  # number of steps that go back in time
    repeated: int = 0  # number of steps of length 0
    duplicates: int = 0  # number of rows equal to the previous row in every channel
    longest_gap: float = 0.0
    bad_row: int = -1  # the first row whose time is not after that of the previous row
    bad_pair: tuple[float, float] = (math.nan, math.nan)
    _mean: float = 0.0  # mean step
    _squares: float = 0.0  # sum of the squared deviations of the steps from their mean
    _last_row: list[float] = field(default_factory=list)

    def update(self, t: Array, channels: Sequence[Array] = ()) -> None:
        """Add the next block: times (N,) and, to find repeated rows, the samples (N,) of every channel."""
        if not len(t):
            return
        if self.samples == 0:
            self.first = float(t[0])
        self._steps(t, np.diff(np.append(self.last, t) if self.samples else t))
        if channels:
            repeats = np.ones(len(t), dtype=bool)
            for number, x in enumerate(channels):
                repeats[1:] &= x[1:] == x[:-1]
                repeats[0] &= bool(self._last_row) and x[0] == self._last_row[number]
            self.duplicates += int(np.count_nonzero(repeats))
            self._last_row = [float(x[-1]) for x in channels]
        self.samples += len(t)
        self.last = float(t[-1])

    def _steps(self, t: Array, steps: Array) -> None:
        if not len(steps):
            return
        bad = np.flatnonzero(steps <= 0)
        if len(bad) and self.bad_row < 0:
            at = int(bad[0]) + (0 if self.samples else 1)
            self.bad_row = self.samples + at
            self.bad_pair = (float(t[at] - steps[bad[0]]), float(t[at]))
        self.backward += int((steps < 0).sum())
        self.repeated += int((steps == 0).sum())
        self.longest_gap = max(self.longest_gap, float(steps.max()))
        # Chan, Golub and LeVeque (1983): merging the moments of two blocks without losing digits.
        before, added = max(self.samples - 1, 0), len(steps)
        mean, squares = float(steps.mean()), float(((steps - steps.mean()) ** 2).sum())
        shift = mean - self._mean
        self._squares += squares + shift**2 * before * added / (before + added)
        self._mean += shift * added / (before + added)

    @property
    def rate(self) -> float:
        """Samples per second over the whole record; 0 with fewer than two samples."""
        return (self.samples - 1) / (self.last - self.first) if self.last > self.first else 0.0

    @property
    def jitter(self) -> float:
        """Standard deviation of the time between samples [s]; 0 if rounding of the times explains the deviation."""
        std = math.sqrt(self._squares / (self.samples - 2)) if self.samples > 2 else 0.0
        return std if std > 1e-9 * abs(self._mean) else 0.0


def remarks(clock: ClockStatistics, rate: float) -> Iterator[str]:
    """State that many rows repeat, and that the time between samples varies or is long, for a clock of `rate` [Hz]."""
    if clock.duplicates > MAX_REPEATED * clock.samples:
        share = f"{clock.duplicates} of {clock.samples} rows ({clock.duplicates / clock.samples:.0%})"
        why = "the recorder ran faster than the robot's measurements"
        yield f"{share} repeat the one before in every channel used: {why}"
    if clock.jitter * rate > MAX_JITTER:
        yield f"the time between samples varies by {clock.jitter * 1e3:.3g} ms around {1e3 / rate:.3g} ms"
    if clock.longest_gap * rate > GAP:
        yield f"the longest time between samples is {clock.longest_gap:.3g} s, {clock.longest_gap * rate:.1f} samples"


def interruptions(t: Array) -> tuple[int, float]:
    """Count the steps of times (N,) that go back or exceed `GAP` times the median step, and add them up [s]."""
    steps = np.diff(t)
    forward = steps[steps > 0]
    unusual = steps[(steps < 0) | (steps > GAP * np.median(forward))] if len(forward) else steps
    return len(unusual), float(unusual.sum())


def cubic(t: Array, x: Array, gap: float, at: Array, within: float = 0.0) -> tuple[Array, Booleans, Booleans]:
    """Interpolate signals `x` (N, C), sampled at times `t` (N,), at the times `at` (K,).

    Returns the values, a mask of the times `within` [s] of a sample, and one of the times between two samples at most
    `gap` [s] apart.  There the values follow the cubic through both, with slopes of the parabolas through a sample and
    its neighbours.  Values at all other times have no meaning.  (Catmull and Rom 1974)
    """
    before: Integers = np.searchsorted(t, at, side="right") - 1
    if not len(t):
        return np.full((len(at), x.shape[1]), np.nan), before >= 0, before >= 0
    left, right = np.maximum(before, 0), np.minimum(before + 1, len(t) - 1)
    nearest = np.where(np.abs(at - t[left]) <= np.abs(t[right] - at), left, right)
    exact = np.abs(t[nearest] - at) <= within
    h = np.diff(t)
    inside = (before >= 0) & (before < len(h)) & ~exact
    inside[inside] = h[before[inside]] <= gap
    values = x[nearest]
    if inside.any():
        i, m, chords = before[inside], np.gradient(x, t, axis=0), np.diff(x, axis=0) / h[:, None]
        gaps = np.flatnonzero(h > gap)  # beside a gap, the slope is that of the chord
        m[gaps], m[gaps + 1] = chords[np.maximum(gaps - 1, 0)], chords[np.minimum(gaps + 1, len(h) - 1)]
        step = h[i][:, None]
        s = (at[inside] - t[i])[:, None] / step
        # Hermite's cubic has given values and slopes at both ends.
        values[inside] = (
            (1 + 2 * s) * (1 - s) ** 2 * x[i] + s * (1 - s) ** 2 * step * m[i]
            + s**2 * (3 - 2 * s) * x[i + 1] + s**2 * (s - 1) * step * m[i + 1]
        )  # fmt: skip
    return values, exact, inside


def longest_bridge(T_s: float) -> float:
    """The longest interval [s] that is interpolated at a sampling time `T_s` [s]: `FILLED` or a sample is missing."""
    return max(GAP * T_s, T_s + FILLED) * (1.0 + TIME_ROUNDING)


def are_gaps(t: Array, T_s: float) -> Booleans:
    """Whether each interval (N-1,) of times (N,) is a gap, for a usual one of `T_s` [s]; an even stretch has none."""
    h = np.diff(t)
    even = np.zeros(len(h), np.bool_)
    for run in runs(np.abs(np.diff(h)) <= ALIKE * h[:-1]):
        even[run.start : run.stop + 1] = run.stop + 1 - run.start >= MIN_INTERVALS_EVEN
    return np.asarray((h > longest_bridge(T_s)) & ~(even & (h <= MAX_PERIOD_RATIO * T_s)))


def distances(t: Array, at: Array) -> Array:
    """Time [s] from each time `at` (K,) to the nearest sample; the samples are at times `t` (N,)."""
    after = np.searchsorted(t, at)
    before = np.abs(at - t[np.maximum(after - 1, 0)])
    return np.asarray(np.minimum(before, np.abs(t[np.minimum(after, len(t) - 1)] - at)))


def are_missing(t: Array, at: Array, T_s: float) -> Booleans:
    """Whether a sample is missing at each time `at` (K,), to which no sample at times `t` (N,) is near."""
    return np.asarray(distances(t, at) > MISSING / 2 * (1.0 + TIME_ROUNDING) * T_s)


def fill(t: Array, x: Array, T_s: float) -> Array:
    """Fill the missing samples, NaN, of a signal (N,) at times (N,), except in gaps and beyond its ends."""
    missing = np.isnan(x)
    values, _, inside = cubic(t[~missing], x[~missing, None], longest_bridge(T_s), t[missing])
    filled = x.copy()
    filled[missing] = np.where(inside, values[:, 0], np.nan)
    return filled


def is_slower(t: Array, missing: Booleans) -> bool:
    """Whether the samples that are not missing (N,) follow in a rhythm of their own, as of one topic of several."""
    samples = np.flatnonzero(~missing)
    if len(samples) <= MIN_INTERVALS_EVEN:
        return False
    h, empty = np.diff(t[samples]), np.diff(samples) > 1
    in_rhythm = h[empty] <= MISSING * np.median(h)
    return int(empty.sum()) >= MIN_INTERVALS_EVEN and float(in_rhythm.mean()) >= MIN_SHARE_RHYTHM


def flat_lowpass(x: Array, ratio: float) -> Array:
    """Low-pass evenly sampled columns (N, C) without delay, for a clock that is `ratio` times as slow.

    The filter has a Kaiser window of 60 dB.  It passes 0.4 of the slower rate unchanged, and nothing from 0.6 of it on.
    So noise is not aliased onto what is passed.  The columns go on beyond their ends by reflection in the end samples.
    """
    from scipy.signal import fftconvolve

    h, weights = half_width(ratio), taps(ratio)[:, None]
    padded = np.pad(x, ((h, h), (0, 0)), mode="reflect", reflect_type="odd")
    return np.asarray(fftconvolve(padded, weights, mode="valid", axes=0))


def half_width(ratio: float) -> int:
    """Number of samples on either side that `flat_lowpass` weighs."""
    return math.ceil(9.1 * ratio)  # (60 - 7.95) / (2.285 * 2 pi 0.2) / 2 clock samples (Kaiser 1974)


@cache
def taps(ratio: float) -> Array:
    """Weights (2 h + 1,) of `flat_lowpass`; their sum is 1."""
    from scipy.signal import firwin

    return np.asarray(firwin(2 * half_width(ratio) + 1, 1.0 / ratio, window=("kaiser", 5.653)))
