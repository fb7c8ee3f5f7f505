"""The course of a signal of any length in a few numbers, gathered block by block."""

import math
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.maths.arrays import Array


@dataclass
class Outline:
    """Extremes, mean, and the means of at most `2 * width` bins of equal length, of what is finite."""

    width: int = 32
    samples: int = 0
    finite: int = 0
    least: float = math.inf
    most: float = -math.inf
    bin_size: int = 1  # samples whose mean is one value of the course
    _sums: Array = field(default_factory=lambda: np.zeros(0))  # of the bins
    _counts: Array = field(default_factory=lambda: np.zeros(0))  # of the finite samples in them

    def update(self, values: Array) -> None:
        """Take in the next block (N,)."""
        good = np.isfinite(values)
        if good.any():
            self.least = min(self.least, float(values[good].min()))
            self.most = max(self.most, float(values[good].max()))
        self.finite += int(good.sum())
        end = self.samples + len(values)
        while end > 2 * self.width * self.bin_size:
            self._halve()
        needed = -(-end // self.bin_size)
        which = np.arange(self.samples, end) // self.bin_size
        self._sums = _grown(self._sums, needed) + np.bincount(which, np.where(good, values, 0.0), minlength=needed)
        self._counts = _grown(self._counts, needed) + np.bincount(which, good, minlength=needed)
        self.samples = end

    def _halve(self) -> None:
        """Bins of twice the length."""
        pairs = (self._sums, self._counts)
        self._sums, self._counts = (np.add.reduceat(p, np.arange(0, len(p), 2)) if len(p) else p for p in pairs)
        self.bin_size *= 2

    @property
    def mean(self) -> float:
        """Mean of the finite samples; NaN where there is none."""
        return float(self._sums.sum()) / self.finite if self.finite else math.nan

    @property
    def course(self) -> Array:
        """Mean of each bin; NaN where it has no finite sample."""
        means = np.full(len(self._sums), np.nan)
        np.divide(self._sums, self._counts, out=means, where=self._counts > 0)
        return means


def _grown(values: Array, length: int) -> Array:
    return np.concatenate([values, np.zeros(max(0, length - len(values)))])
