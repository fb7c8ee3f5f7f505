"""Statistics of a log's clock, computed block by block, and interpolation between its samples."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers

GAP = 2.5  # sampling times: a longer interval between two samples is an interruption


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
        steps = np.diff(t, prepend=[self.last] if self.samples else t[:1])[0 if self.samples else 1 :]
        self._steps(t, steps)
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


def cubic(t: Array, x: Array, gap: float, at: Array) -> tuple[Array, Booleans, Booleans]:
    """Interpolate signals `x` (N, C), sampled at times `t` (N,), at the times `at` (K,).

    Returns the values, a mask of the times of samples, and a mask of the times between two samples at most `gap` [s]
    apart.  Between two samples the values follow the cubic through both.  Its slope at a sample is that of the parabola
    through the sample and its neighbours.  Values at all other times have no meaning.  (Catmull and Rom 1974)
    """
    before: Integers = np.searchsorted(t, at, side="right") - 1
    if not len(t):
        return np.full((len(at), x.shape[1]), np.nan), before >= 0, before >= 0
    exact = (before >= 0) & (t[np.maximum(before, 0)] == at)
    h = np.diff(t)
    inside = (before >= 0) & (before < len(h)) & ~exact
    inside[inside] = h[before[inside]] <= gap
    values = x[np.maximum(before, 0)]
    if inside.any():
        i = before[inside]
        m, step = _slopes(x, h, gap), h[i][:, None]
        s = (at[inside] - t[i])[:, None] / step
        # Hermite's cubic has given values and slopes at both ends.
        values[inside] = (
            (1 + 2 * s) * (1 - s) ** 2 * x[i] + s * (1 - s) ** 2 * step * m[i]
            + s**2 * (3 - 2 * s) * x[i + 1] + s**2 * (s - 1) * step * m[i + 1]
        )  # fmt: skip
    return values, exact, inside


def _slopes(x: Array, h: Array, gap: float) -> Array:
    """Slopes (N, C) of the parabolas through each sample and its neighbours; next to a gap, that of the chord.

    A parabola's slope is the mean of its two chords' slopes, each weighted by the other's step.
    """
    chords = np.diff(x, axis=0) / h[:, None]
    near = h <= gap
    step = np.zeros((2, len(x)))  # to the left and to the right neighbour; 0 without a neighbour
    step[0, 1:], step[1, :-1] = np.where(near, h, 0.0), np.where(near, h, 0.0)
    weight = np.where(step[::-1] > 0, step[::-1], 1.0) * (step > 0)
    all_chords = np.zeros((2, *x.shape))
    all_chords[0, 1:], all_chords[1, :-1] = chords, chords
    return np.asarray((weight[:, :, None] * all_chords).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-300)[:, None])


def means(t: Array, x: Array, many: int, gap: float) -> tuple[Array, Array, int]:
    """Average every `many` consecutive times (N,) and samples (N, C) into one, none across a gap.

    Also returns the number of samples at the end that are too few for a mean.
    """
    cuts = np.flatnonzero(np.diff(t) > gap) + 1
    begins, ends = np.array([0, *cuts]), np.array([*cuts, len(t)])
    whole = np.concatenate([np.arange(b, e - many + 1, many) for b, e in zip(begins, ends, strict=True)])
    indices = whole[:, None] + np.arange(many)
    return t[indices].mean(axis=1), x[indices].mean(axis=1), int((ends[-1] - begins[-1]) % many)
