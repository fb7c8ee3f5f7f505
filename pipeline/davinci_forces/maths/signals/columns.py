"""Telling columns without names by what they hold: a time, positions, velocities, and what comes after them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

SMOOTHED = 9  # samples over which a difference is averaged before it is set against a velocity
FOLLOWS = 0.9  # correlation from which a column is the velocity of another
MOVES = 0.02  # of the widest column's range, from which a joint moves
STILL = 0.005  # [rad or m] range of an arm that stands still
ROUND = (1.0, 1.25, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0)  # times a power of ten: rates that recorders are set to
NEAR = 0.01  # relative, by how much a rate that velocities tell may miss a round one
SEVERAL = 2.0  # times a current, from which what is proportional to it is a torque
NOISY = 300  # parts of a recording, over one of which a velocity is averaged
SHORT = 100  # parts of a recording, over one of which a velocity may be held
LEVEL = 0.1  # relative change within which it is
RESTS = 0.02  # of the highest speed, below which a joint rests
STEADY = 0.28  # share of the moving samples from which it is held: ramps and returns lie between levels


class Blocks(NamedTuple):
    """Columns in blocks of n: positions first, then their velocities."""

    n: int
    rate: float  # samples a second by which the velocities are those of the positions; 1 where times were given
    moving: tuple[int, ...]  # joints, counted from 0
    correlation: float  # the least of a joint that moves


def rising(columns: Sequence[Array]) -> int | None:
    """The first column (N,) that increases from every sample to the next, as a time does."""
    found = (i for i, column in enumerate(columns) if len(column) > 2 and bool(np.all(np.diff(column) > 0)))
    return next(found, None)


def moving(positions: Sequence[Array]) -> tuple[int, ...]:
    """Which positions (N,) move: by a share of what the widest does, and beyond the noise of an arm at rest."""
    ranges = [float(np.ptp(q)) for q in positions]
    return tuple(i for i, width in enumerate(ranges) if width >= max(MOVES * max(ranges), STILL))


def blocks(columns: Sequence[Array], t: Array | None = None) -> Blocks | None:
    """How many joints there are, by the velocities being the derivatives of the positions; None where none are.

    `columns` (N,) each, of n positions, n velocities and more; `t` (N,) [s] where there is a time.
    """
    for n in range(len(columns) // 3, 0, -1):
        moves = moving(columns[:n])
        pairs = [derivative(columns[i], columns[n + i], t) for i in moves]
        if pairs and min(correlation for correlation, _ in pairs) >= FOLLOWS:
            best = max(pairs)
            return Blocks(n, best[1], moves, min(correlation for correlation, _ in pairs))
    return None


def derivative(q: Array, dq: Array, t: Array | None = None) -> tuple[float, float]:
    """The correlation of a velocity (N,) with the differences of a position (N,), and samples a second by their slope.

    Both are averaged over a few samples; the slope is the geometric mean of the two regressions, as both have errors.
    """
    steps = np.diff(q) if t is None else np.diff(q) / np.diff(t)
    mean = np.ones(SMOOTHED) / SMOOTHED
    if len(steps) < 2 * SMOOTHED:
        return 0.0, 0.0
    x, y = (np.convolve(each, mean, "valid") for each in (steps, 0.5 * (dq[1:] + dq[:-1])))
    x, y = x - x.mean(), y - y.mean()
    if not (x @ x > 0 and y @ y > 0):
        return 0.0, 0.0
    return float(x @ y / np.sqrt((x @ x) * (y @ y))), float(np.sqrt((y @ y) / (x @ x)))


def round_rate(rate: float) -> float:
    """The round rate that a rate is near, else the rate itself to four digits."""
    power = 10.0 ** np.floor(np.log10(rate))
    nearest = min((factor * power for factor in ROUND), key=lambda each: abs(each - rate))
    return float(nearest if abs(nearest - rate) <= NEAR * rate else f"{rate:.4g}")


def is_current(measured: Sequence[Array], others: Sequence[Sequence[Array]], moves: Sequence[int]) -> bool:
    """Whether a block of columns is of currents, as torques of some other block are proportional to it, or to its like.

    `measured` (N,) each; `others`, blocks of as many columns; `moves`, the columns by which blocks are alike.
    """
    alike = [measured, *(other for other in others if all(_alike(measured[i], other[i]) for i in moves))]
    return any(_is_larger(one, other) for one in alike for other in others)


def _is_larger(one: Sequence[Array], other: Sequence[Array]) -> bool:
    """Whether columns of a block are several times those of another that they are proportional to."""
    pairs = [_proportion(x, y) for x, y in zip(one, other, strict=True)]
    return sum(cosine > FOLLOWS and factor > SEVERAL for cosine, factor in pairs) >= min(2, len(pairs))


def _alike(x: Array, y: Array) -> bool:
    cosine, factor = _proportion(x, y)
    return cosine > FOLLOWS and 1 / SEVERAL < factor < SEVERAL


def _proportion(x: Array, y: Array) -> tuple[float, float]:
    """The cosine between two columns (N,), and how many times the second is as large; 0 where one holds nothing."""
    sizes = float(np.linalg.norm(x)), float(np.linalg.norm(y))
    return (float(x @ y) / (sizes[0] * sizes[1]), sizes[1] / sizes[0]) if all(sizes) else (0.0, 0.0)


def is_steady(velocity: Array) -> bool:
    """Whether a velocity (N,) is held at level after level, as in runs that tell of friction.

    Neighbouring samples are averaged, so that noise does not hide a level.
    """
    return steadiness(velocity) >= STEADY


def steadiness(velocity: Array) -> float:
    """The share of the moving samples of a velocity (N,) from which it hardly changes within a short while."""
    N = len(velocity)
    width, lag = max(N // NOISY, 1), max(N // SHORT, 1)
    v = np.convolve(velocity, np.ones(width) / width, "valid")
    if len(v) <= 2 * lag or not v.any():
        return 0.0
    size = np.abs(v[lag:])
    moves = size > RESTS * size.max()
    return float((np.abs(v[lag:] - v[:-lag]) < LEVEL * size)[moves].mean()) if moves.any() else 0.0


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
