"""Recognise columns without names by their values: a time, positions, velocities, currents and torques."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

SMOOTHED = 9  # samples in the mean of differences that is compared with a velocity
MIN_COSINE = 0.9  # columns with a larger cosine are proportional
MIN_RANGE_SHARE = 0.02  # a joint moves if its range is at least this share of the widest column's
MIN_RANGE_MOVING = 0.005  # [rad or m] an arm with a smaller range stands still
ROUND = (1.0, 1.25, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0)  # recorders are set to one of these rates times a power of ten
ROUND_RATE_TOLERANCE = 0.01  # relative distance at which a rate from velocities is rounded
MIN_RATIO_TORQUE = 2.0  # a column proportional to a current and this many times larger is a torque
AVERAGED_PARTS = 300  # of a recording: a velocity is averaged over one part
STEADY_PARTS = 100  # of a recording: a velocity is steady if it hardly changes within one part
MAX_CHANGE_LEVEL = 0.1  # largest relative change of a steady velocity
MIN_SPEED_SHARE = 0.02  # a joint is at rest below this share of its highest speed
MIN_STEADY_SHARE = 0.28  # of moving samples that are steady; the others are ramps and returns between levels


class Blocks(NamedTuple):
    """Columns in blocks of n joints: positions first, then their velocities."""

    n: int
    rate: float  # [Hz] at which the velocities fit the positions; 1 if times are given
    moving: tuple[int, ...]  # joints, counted from 0
    correlation: float  # the lowest among the joints that move


def first_rising_column(columns: Sequence[Array]) -> int | None:
    """The first column (N,) that increases from every sample to the next, as a time does."""
    indices = (i for i, column in enumerate(columns) if len(column) > 2 and bool(np.all(np.diff(column) > 0)))
    return next(indices, None)


def moving_positions(positions: Sequence[Array]) -> tuple[int, ...]:
    """Indices of the positions (N,) whose range exceeds a share of the widest one, and the noise at rest."""
    ranges = [float(np.ptp(q)) if len(q) else 0.0 for q in positions]
    return tuple(i for i, width in enumerate(ranges) if width >= max(MIN_RANGE_SHARE * max(ranges), MIN_RANGE_MOVING))


def blocks(columns: Sequence[Array], t: Array | None = None) -> Blocks | None:
    """Find the number of joints n for which the second n columns are the derivatives of the first n, or None.

    `columns` (N,) each, of n positions, n velocities and more; `t` (N,) [s], or None without a time column.
    """
    for n in range(len(columns) // 3, 0, -1):
        moves = moving_positions(columns[:n])
        pairs = [derivative(columns[i], columns[n + i], t) for i in moves]
        if pairs and min(pairs)[0] >= MIN_COSINE:
            return Blocks(n, max(pairs)[1], moves, min(pairs)[0])
    return None


def derivative(q: Array, dq: Array, t: Array | None = None) -> tuple[float, float]:
    """Correlation of a velocity (N,) with the differences of a position (N,), and the sampling rate [Hz] by the slope.

    Both are averaged over a few samples.  The slope is the geometric mean of two regressions, as both have errors.
    """
    steps = np.diff(q) if t is None else np.diff(q) / np.diff(t)
    mean = np.ones(SMOOTHED) / SMOOTHED
    if len(steps) < 2 * SMOOTHED:
        return 0.0, 0.0
    x, y = (np.convolve(column, mean, "valid") for column in (steps, 0.5 * (dq[1:] + dq[:-1])))
    (xx, xy), (_, yy) = np.cov(x, y).tolist()
    return (xy / math.sqrt(xx * yy), math.sqrt(yy / xx)) if xx * yy > 0.0 else (0.0, 0.0)


def round_rate(rate: float) -> float:
    """Round a rate to the nearest usual rate if both are close, else to four digits."""
    power = 10.0 ** np.floor(np.log10(rate))
    nearest = min((factor * power for factor in ROUND), key=lambda candidate: abs(candidate - rate))
    return float(nearest if abs(nearest - rate) <= ROUND_RATE_TOLERANCE * rate else f"{rate:.4g}")


def is_current(measured: Sequence[Array], others: Sequence[Sequence[Array]], moves: Sequence[int]) -> bool:
    """Whether a block of columns holds currents: another block, of torques, is proportional to it or to a similar one.

    `measured` (N,) each; `others`, blocks of as many columns; `moves`, the columns by which blocks are compared.
    """
    alike = [measured, *(block for block in others if all(_alike(measured[i], block[i]) for i in moves))]

    def is_larger(currents: Sequence[Array], block: Sequence[Array]) -> bool:
        pairs = [_proportion(x, y) for x, y in zip(currents, block, strict=True)]
        larger = [cosine > MIN_COSINE and factor > MIN_RATIO_TORQUE for cosine, factor in pairs]
        return sum(larger) >= min(2, len(pairs))

    return any(is_larger(currents, block) for currents in alike for block in others)


def _alike(x: Array, y: Array) -> bool:
    cosine, factor = _proportion(x, y)
    return cosine > MIN_COSINE and 1 / MIN_RATIO_TORQUE < factor < MIN_RATIO_TORQUE


def _proportion(x: Array, y: Array) -> tuple[float, float]:
    """Cosine between two columns (N,), and the ratio of the second's size to the first's; 0 if one is zero."""
    sizes = float(np.linalg.norm(x)), float(np.linalg.norm(y))
    return (float(x @ y) / (sizes[0] * sizes[1]), sizes[1] / sizes[0]) if all(sizes) else (0.0, 0.0)


def is_steady(velocity: Array) -> bool:
    """Whether a velocity (N,) stays at one level after another, as in recordings for friction.

    It hardly changes after most moving samples.  Neighbouring samples are averaged, so that noise hides no level.
    """
    N = len(velocity)
    width, lag = max(N // AVERAGED_PARTS, 1), max(N // STEADY_PARTS, 1)
    v = np.convolve(velocity, np.ones(width) / width, "valid")
    if len(v) <= 2 * lag or not v.any():
        return False
    speed = np.abs(v[lag:])
    moves = speed > MIN_SPEED_SHARE * speed.max()
    is_level = (np.abs(v[lag:] - v[:-lag]) < MAX_CHANGE_LEVEL * speed)[moves]
    return bool(moves.any() and is_level.mean() >= MIN_STEADY_SHARE)


@dataclass
class Outline:
    """Extremes, mean and course of the finite samples; the course is the means of at most `2 * width` equal bins."""

    width: int = 32
    samples: int = 0
    finite: int = 0
    least: float = math.inf
    most: float = -math.inf
    bin_size: int = 1  # samples whose mean is one value of the course
    _bins: Array = field(default_factory=lambda: np.zeros((2, 0)))  # sum and number of the finite samples in each

    def update(self, values: Array) -> None:
        """Add the next block (N,)."""
        finite = np.isfinite(values)
        if finite.any():
            self.least = min(self.least, float(values[finite].min()))
            self.most = max(self.most, float(values[finite].max()))
        self.finite += int(finite.sum())
        end = self.samples + len(values)
        while end > 2 * self.width * self.bin_size:  # join bins in pairs, which doubles their length
            bins = self._bins
            self._bins = np.add.reduceat(bins, np.arange(0, bins.shape[1], 2), axis=1) if bins.size else bins
            self.bin_size *= 2
        number, needed = np.arange(self.samples, end) // self.bin_size, -(-end // self.bin_size)
        bins = np.array([np.bincount(number, x, needed) for x in (np.where(finite, values, 0.0), finite)], float)
        bins[:, : self._bins.shape[1]] += self._bins
        self._bins, self.samples = bins, end

    @property
    def mean(self) -> float:
        """Mean of the finite samples; NaN if there is none."""
        return float(self._bins[0].sum()) / self.finite if self.finite else math.nan

    @property
    def course(self) -> Array:
        """Mean of each bin; NaN where it has no finite sample."""
        sums, counts = self._bins
        return np.asarray(np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0))
