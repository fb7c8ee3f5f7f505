"""What the times of a log say about its recorder, gathered block by block."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.maths.arrays import Array

GAP = 2.5  # sampling times between two samples that count as an interruption


@dataclass
class ClockStatistics:
    """Running facts about a clock and the rows that go with it.  Times in seconds; rows are counted from 0."""

    samples: int = 0
    first: float = math.nan
    last: float = math.nan
    backward: int = 0  # steps that go back
    repeated: int = 0  # steps of length 0
    duplicates: int = 0  # rows equal to the one before in every channel
    longest_gap: float = 0.0
    bad_row: int = -1  # the first row whose time is not after the one before
    bad_pair: tuple[float, float] = (math.nan, math.nan)
    _mean: float = 0.0  # of the steps
    _squares: float = 0.0  # sum of squared deviations from it
    _last_row: list[float] = field(default_factory=list)

    def update(self, t: Array, channels: Sequence[Array] = ()) -> None:
        """Take in the next block: times (N,) and, to find repeated rows, the samples (N,) of every channel."""
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
        """Samples per second over the whole record; 0 before there are two."""
        return (self.samples - 1) / (self.last - self.first) if self.last > self.first else 0.0

    @property
    def jitter(self) -> float:
        """Standard deviation of the time between samples [s]; 0 where it is the rounding of the times themselves."""
        std = math.sqrt(self._squares / (self.samples - 2)) if self.samples > 2 else 0.0
        return std if std > 1e-9 * abs(self._mean) else 0.0
