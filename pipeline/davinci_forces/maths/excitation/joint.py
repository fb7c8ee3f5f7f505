"""Design the most informative trajectory of a joint, within limits that hold at every instant.  Section 6.3.2

The search is unconstrained: any numbers z (..., 1 + 2 N_f) are mapped to trajectories within the limits.  They are the
coefficients of a series x = (a0, a1, b1, ...), but for two of them.  z[0] places the mean in the slack that the
harmonics leave.  Time may start anywhere, so it starts at a standstill, where the a_k add up to zero.  That determines
a_N, whose place in z holds the distance of the standstill from an instant of the criterion.  Friction jumps there, and
with it the criterion: the best trajectories come to rest within millionths of a sample of such an instant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import CRITERIA, PERIOD_SAMPLES, Fourier, Range, basis, instants, ranges
from davinci_forces.maths.excitation.search import ReportStart, ignore_start, minimise
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import Term

MARGIN = 1e-9  # of the limits, so that they also hold for printed numbers
GRID = 96  # instants a harmonic of the search for extremes, which are found to 1e-7


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
        """Coefficients of a standstill in the middle of the positions, which is within every limit."""
        return np.array([sum(self.limits[0]) / 2, *[0.0] * (2 * self.harmonics)])


class Design(NamedTuple):
    """A designed trajectory, and the lowest criterion of each start of the search (starts,)."""

    series: Fourier
    optima: Array


def impossible(limits: tuple[Range, Range, Range]) -> str:
    """Why no periodic trajectory can keep these limits and move, or "" if one can."""
    (low, high), *rates = limits
    if not np.isfinite([low, high]).all():
        return f"positions must be limited on both sides to design a trajectory, not {low:g} to {high:g}"
    if low >= high:
        return f"there is no position between {low:g} and {high:g}"
    for name, (lower, upper) in zip(("velocity", "acceleration"), rates, strict=True):
        if not lower < 0 < upper:
            return (
                f"the {name} of a periodic motion is positive and negative by turns (its mean is zero), "
                f"so the limits {lower:g} to {upper:g} must have zero between them"
            )
    return ""


def design(problem: ExcitationProblem, starts: int, seed: int, report_start: ReportStart = ignore_start) -> Design:
    """Design the best of several optima, each of its own population.  (6.27)

    Raises
    ------
    ValueError
        If the limits cannot be kept, or if the regressor of every trajectory is rank deficient.
    """
    if reason := impossible(problem.limits):
        raise ValueError(reason)
    bases = [B.T for B in basis(problem.period, problem.harmonics, instants(problem.period, problem.samples))]

    def objective(z: Array) -> Array:
        x = trajectories(problem, z)
        return CRITERIA[problem.criterion](regressor(problem.terms, *(x @ B for B in bases)))

    best = minimise(objective, 1 + 2 * problem.harmonics, starts, seed, report_start)
    if not np.isfinite(best.values).any():
        names = ", ".join(term.name for term in problem.terms)
        raise ValueError(f"no trajectory of {problem.harmonics} harmonics identifies all of the terms {names}")
    x = trajectories(problem, best.z[None])[0]
    return Design(shrink_into_limits(problem, Fourier.from_coefficients(x, problem.period)), best.values)


def trajectories(problem: ExcitationProblem, z: Array) -> Array:
    """Map any numbers z (S, 1 + 2 N_f) to coefficients x (S, 1 + 2 N_f) within the limits."""
    return scale_to_limits(delay(*from_standstill(z, problem.samples)), problem.limits, problem.period)


def shrink_into_limits(problem: ExcitationProblem, series: Fourier) -> Fourier:
    """Shrink the series towards a standstill until every limit holds at every instant.

    The trajectories within the limits are a convex set, so the factor follows from the exact extrema of the series.
    """
    scale = 1.0
    for (low, high), (low_x, high_x), middle in zip(
        problem.limits, ranges(series), (problem.centre[0], 0.0, 0.0), strict=True
    ):
        scale = max(scale, (high_x - middle) / (high - middle), (low_x - middle) / (low - middle))
    if scale == 1.0:
        return series
    shrunk = (series.x - problem.centre) / (scale * (1 + MARGIN))
    return Fourier.from_coefficients(problem.centre + shrunk, series.period)


Indices = NDArray[np.intp]


def scale_to_limits(z: Array, limits: tuple[Range, Range, Range], period: float) -> Array:
    """Scale series to coefficients x (S, 1 + 2 N_f) that keep the limits, to about 1e-7 of them.

    Harmonics c of size n, where 1 touches a limit, become 2 c / (1 + n^2): of all sizes up to 1, and flat at 1.
    """
    low, high = limits[0]
    lowest, highest = extremes(z[:, 1:], period)
    n = (highest[0] - lowest[0]) / (high - low)
    for i in (1, 2):
        n = np.maximum(n, np.maximum(lowest[i] / limits[i][0], highest[i] / limits[i][1]))
    scale = 2 / (1 + n**2)
    slack = high - low - scale * (highest[0] - lowest[0])
    mean = low - scale * lowest[0] + slack * (1 + np.sin(z[:, 0])) / 2
    return np.column_stack([mean, scale[:, None] * z[:, 1:]])


def from_standstill(z: Array, samples: int) -> tuple[Array, Array]:
    """Complete z (S, 1 + 2 N_f) by the harmonic that makes it stand still at 0; and the phase (S,) [rad] of its delay.

    The cube favours phases that are small against that between two of `samples` instants.
    """
    free = z[:, -2]
    complete = z.copy()
    complete[:, -2] = -z[:, 1:-2:2].sum(axis=1)
    return complete, np.pi / samples * free**3


def delay(z: Array, phase: Array) -> Array:
    """Delay series z (S, 1 + 2 N_f) by this phase (S,) [rad] of the period."""
    k = np.arange(1, z.shape[1] // 2 + 1)
    velocity = (z[:, 1::2] - 1j * z[:, 2::2]) * np.exp(-1j * k * phase[:, None])  # a cos + b sin = Re(velocity e^i)
    moved = z.copy()
    moved[:, 1::2], moved[:, 2::2] = velocity.real, -velocity.imag
    return moved


def extremes(c: Array, period: float) -> tuple[Array, Array]:
    """The lowest and highest position, velocity and acceleration (3, S) of harmonics c (S, 2 N_f) about a mean of 0.

    At each extreme on a grid, a parabola through it and its neighbours gives the time to the second order of a step.
    The value there is accurate to the fourth order.
    """
    harmonics = c.shape[1] // 2
    grid = c @ _grid(period, harmonics)
    before, values, after = grid[..., :-2], grid[..., 1:-1].copy(), grid[..., 2:]
    turning = np.unravel_index(np.flatnonzero((values >= before) == (values >= after)), values.shape)
    rise, bend = after[turning] - before[turning], before[turning] - 2 * values[turning] + after[turning]
    step = np.divide(-rise, 2 * bend, out=np.zeros_like(rise), where=bend != 0)
    values[turning] = _values(c, period, turning[0], turning[1], (turning[2] + step) / (GRID * harmonics))
    return values.min(axis=-1), values.max(axis=-1)


def _values(c: Array, period: float, derivative: Indices, of: Indices, where: Array) -> Array:
    """Position (0), velocity (1) or acceleration (2) of the series `of` (P,) of c `where` (P,) in the period."""
    jw = 2j * np.pi / period * np.arange(1, c.shape[1] // 2 + 1)
    phasors = (c[:, ::2] - 1j * c[:, 1::2]).T * np.array([1 / jw, np.ones_like(jw), jw])[..., None]
    turn = np.exp(2j * np.pi * where)
    total = np.zeros_like(turn)
    for phasor in reversed(np.swapaxes(phasors, 0, 1)):  # Horner's scheme
        total = (total + phasor[derivative, of]) * turn
    return np.asarray(total.real)


@lru_cache(maxsize=8)
def _grid(period: float, harmonics: int) -> Array:
    """Bases of position, velocity and acceleration (3, 2 N_f, G + 2) over a period and a step to both sides."""
    steps = GRID * harmonics
    t = np.arange(-1.0, steps + 1, dtype=np.float64) * (period / steps)
    return np.stack([B[:, 1:].T for B in basis(period, harmonics, t)])
