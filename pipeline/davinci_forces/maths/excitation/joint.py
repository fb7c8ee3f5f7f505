"""Design the most informative trajectory of a joint, within limits that hold at every instant.  Section 6.3.2

The search is unconstrained: any numbers z (..., 1 + 2 N_f) are mapped to a trajectory within the limits.  They are the
coefficients of a series x = (a0, a1, b1, ...), with two exceptions.  z[0] determines the mean within the range that the
harmonics leave.  The series starts at a standstill, which is no restriction because it is periodic; its a_k then add up
to zero and determine a_N.  In place of a_N, z has the time between the standstill and a sample of the criterion.  At a
standstill friction jumps, and with it the criterion.  The best standstills are within millionths of a sample interval.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import CRITERIA, PERIOD_SAMPLES, Fourier, Range, basis, instants, ranges
from davinci_forces.maths.excitation.search import ReportStart, best_of_starts, descend
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import Term

MARGIN = 1e-9  # share of the limits that is not used, so that rounded printed numbers also keep them
GRID = 96  # instants for each harmonic in `extremes`, which are then accurate to 1e-7


@dataclass(frozen=True)
class ExcitationProblem:
    """The excitation of one joint: its model, and lower and upper limits of position, velocity and acceleration."""

    terms: Sequence[Term]
    limits: tuple[Range, Range, Range]
    period: float
    harmonics: int
    criterion: str = "determinant"
    samples: int = PERIOD_SAMPLES

    @property
    def centre(self) -> Array:
        """Coefficients of rest at the mean position, which is within all limits."""
        return np.array([sum(self.limits[0]) / 2, *[0.0] * (2 * self.harmonics)])


def impossible(limits: tuple[Range, Range, Range]) -> str:
    """The reason why no periodic motion can keep these limits; "" if one can."""
    (low, high), *rates = limits
    if not np.isfinite([low, high]).all():
        return f"positions must be limited on both sides to design a trajectory, not {low:g} to {high:g}"
    if low >= high:
        return f"there is no position between {low:g} and {high:g}"
    for name, (lower, upper) in zip(("velocity", "acceleration"), rates, strict=True):
        if not lower < 0 < upper:
            why = f"the {name} of a periodic motion is positive and negative by turns (its mean is zero)"
            return f"{why}, so the limits {lower:g} to {upper:g} must have zero between them"
    return ""


def design(
    problem: ExcitationProblem, starts: int, seed: int, report_start: ReportStart | None = None
) -> tuple[Fourier, Array]:
    """Design the trajectory of the best of several starts, and return the criterion of each (starts,), too.  (6.27)

    Raises ValueError if the limits cannot be kept, or if the regressor of every trajectory is rank deficient.
    """
    if reason := impossible(problem.limits):
        raise ValueError(reason)
    bases = [B.T for B in basis(problem.period, problem.harmonics, instants(problem.period, problem.samples))]

    def objective(z: Array) -> Array:
        x = trajectories(problem, z)
        return CRITERIA[problem.criterion](regressor(problem.terms, *(x @ B for B in bases)))

    size = 1 + 2 * problem.harmonics
    best, values = best_of_starts(lambda random: descend(objective, size, random), starts, seed, report_start)
    if not np.isfinite(values).any():
        names = ", ".join(term.name for term in problem.terms)
        raise ValueError(f"no trajectory of {problem.harmonics} harmonics identifies all of the terms {names}")
    x = trajectories(problem, best[None])[0]
    return shrink_to_limits(problem, Fourier.from_coefficients(x, problem.period)), values


def trajectories(problem: ExcitationProblem, z: Array) -> Array:
    """Map any numbers z (S, 1 + 2 N_f) to coefficients x (S, 1 + 2 N_f) within the limits."""
    return scale_to_limits(delay(*from_standstill(z, problem.samples)), problem.limits, problem.period)


def shrink_to_limits(problem: ExcitationProblem, series: Fourier) -> Fourier:
    """Shrink the series towards rest at the mean position until every limit holds at every instant.

    The trajectories within the limits are a convex set, so the factor follows from the exact extrema of the series.
    """
    scale, middles = 1.0, (problem.centre[0], 0.0, 0.0)
    for (low, high), (low_x, high_x), middle in zip(problem.limits, ranges(series), middles, strict=True):
        scale = max(scale, (high_x - middle) / (high - middle), (low_x - middle) / (low - middle))
    if scale == 1.0:
        return series
    motion = (series.x - problem.centre) / (scale * (1 + MARGIN))
    return Fourier.from_coefficients(problem.centre + motion, series.period)


def scale_to_limits(z: Array, limits: tuple[Range, Range, Range], period: float) -> Array:
    """Scale z to coefficients x (S, 1 + 2 N_f) of series that keep the limits, except for about 1e-7 of them.

    Harmonics c of size n, with n = 1 at the first limit, become 2 c / (1 + n^2): the size is largest, 1, for n = 1.
    """
    low, high = limits[0]
    lowest, highest = extremes(z[:, 1:], period)
    scale = 2 / (1 + limit_share(lowest, highest, limits) ** 2)
    slack = high - low - scale * (highest[0] - lowest[0])
    mean = low - scale * lowest[0] + slack * (1 + np.sin(z[:, 0])) / 2
    return np.column_stack([mean, scale[:, None] * z[:, 1:]])


def limit_share(lowest: Array, highest: Array, limits: tuple[Range, Range, Range]) -> Array:
    """The size (S,) of harmonics with these extremes (3, S), as a share of the first limit that they reach."""
    share = (highest[0] - lowest[0]) / (limits[0][1] - limits[0][0])
    for i in (1, 2):
        share = np.maximum(share, np.maximum(lowest[i] / limits[i][0], highest[i] / limits[i][1]))
    return np.asarray(share)


def from_standstill(z: Array, samples: int) -> tuple[Array, Array]:
    """Compute a_N, so that the series z (S, 1 + 2 N_f) stands still at t = 0, and the phase (S,) [rad] of its delay.

    The cube favours phases much smaller than the phase between two of the `samples` instants.
    """
    complete = z.copy()
    complete[:, -2] = -z[:, 1:-2:2].sum(axis=1)
    return complete, np.pi / samples * z[:, -2] ** 3


def delay(z: Array, phase: Array) -> Array:
    """Delay series z (S, 1 + 2 N_f) by a phase (S,) [rad], where a period is 2 pi."""
    k = np.arange(1, z.shape[1] // 2 + 1)
    velocity = (z[:, 1::2] - 1j * z[:, 2::2]) * np.exp(-1j * k * phase[:, None])  # a cos + b sin = Re(velocity e^i)
    moved = z.copy()
    moved[:, 1::2], moved[:, 2::2] = velocity.real, -velocity.imag
    return moved


def extremes(c: Array, period: float) -> tuple[Array, Array]:
    """The lowest and highest position, velocity and acceleration (3, S) of harmonics c (S, 2 N_f) with a mean of 0.

    A parabola through each extreme of a grid and its neighbours gives its time; the value's error is of fourth order.
    """
    harmonics = c.shape[1] // 2
    grid = c @ _grid(period, harmonics)
    before, values, after = grid[..., :-2], grid[..., 1:-1].copy(), grid[..., 2:]
    turning = np.unravel_index(np.flatnonzero((values >= before) == (values >= after)), values.shape)
    rise, bend = after[turning] - before[turning], before[turning] - 2 * values[turning] + after[turning]
    step = np.divide(-rise, 2 * bend, out=np.zeros_like(rise), where=bend != 0)
    values[turning] = _values(c, period, turning[0], turning[1], (turning[2] + step) / (GRID * harmonics))
    return values.min(axis=-1), values.max(axis=-1)


def _values(c: Array, period: float, derivative: NDArray[np.intp], row: NDArray[np.intp], time: Array) -> Array:
    """Position (0), velocity (1) or acceleration (2) of the `row` (P,) of c, at a `time` (P,) in periods."""
    jw = 2j * np.pi / period * np.arange(1, c.shape[1] // 2 + 1)
    phasors = (c[:, ::2] - 1j * c[:, 1::2]).T * np.array([1 / jw, np.ones_like(jw), jw])[..., None]
    turn = np.exp(2j * np.pi * time)
    total = np.zeros_like(turn)
    for phasor in reversed(np.swapaxes(phasors, 0, 1)):  # Horner's scheme
        total = (total + phasor[derivative, row]) * turn
    return np.asarray(total.real)


@lru_cache(maxsize=8)
def _grid(period: float, harmonics: int) -> Array:
    """Bases of position, velocity and acceleration (3, 2 N_f, G + 2) over a period, with one more step at each end."""
    steps = GRID * harmonics
    t = np.arange(-1.0, steps + 1, dtype=np.float64) * (period / steps)
    return np.stack([B[:, 1:].T for B in basis(period, harmonics, t)])
