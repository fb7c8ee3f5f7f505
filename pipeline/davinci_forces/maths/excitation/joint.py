"""The trajectory that tells most about a joint, within limits that hold at every instant.  Section 6.3.2"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.criterion import CRITERIA
from davinci_forces.maths.excitation.directions import delayed, fitted, from_standstill
from davinci_forces.maths.excitation.fourier import SAMPLES, Fourier, Range, basis, instants, ranges
from davinci_forces.maths.excitation.search import Tell, lowest, nothing
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import Term

MARGIN = 1e-9  # of the limits, so that they also hold for numbers rounded on paper


@dataclass(frozen=True)
class ExcitationProblem:
    """One joint to be excited: its model, and the lower and upper limits of position, velocity and acceleration."""

    terms: Sequence[Term]
    limits: tuple[Range, Range, Range]
    period: float
    harmonics: int
    criterion: str = "determinant"
    samples: int = SAMPLES

    @property
    def centre(self) -> Array:
        """The coefficients of standing still in the middle of the positions, which is within every limit."""
        return np.array([sum(self.limits[0]) / 2, *[0.0] * (2 * self.harmonics)])


class Design(NamedTuple):
    """A designed trajectory, and the lowest criterion that each start of the search has come to (starts,)."""

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


def design(problem: ExcitationProblem, starts: int, seed: int, tell: Tell = nothing) -> Design:
    """The best of several optima, each of a population of its own.  (6.27)

    Raises
    ------
    ValueError
        If the limits cannot be kept, or if no trajectory tells the terms apart.
    """
    if reason := impossible(problem.limits):
        raise ValueError(reason)
    bases = [B.T for B in basis(problem.period, problem.harmonics, instants(problem.period, problem.samples))]

    def objective(z: Array) -> Array:
        x = trajectories(problem, z)
        return CRITERIA[problem.criterion](regressor(problem.terms, *(x @ B for B in bases)))

    best = lowest(objective, 1 + 2 * problem.harmonics, starts, seed, tell)
    if not np.isfinite(best.values).any():
        names = ", ".join(term.name for term in problem.terms)
        raise ValueError(f"no trajectory of {problem.harmonics} harmonics tells the terms {names} apart")
    x = trajectories(problem, best.z[None])[0]
    return Design(within(problem, Fourier.of(x, problem.period)), best.values)


def trajectories(problem: ExcitationProblem, z: Array) -> Array:
    """Coefficients x (S, 1 + 2 N_f) within the limits, of any numbers z (S, 1 + 2 N_f)."""
    return fitted(delayed(*from_standstill(z, problem.samples)), problem.limits, problem.period)


def within(problem: ExcitationProblem, series: Fourier) -> Fourier:
    """The series shrunk towards standing still until every limit holds at every instant.

    The trajectories within the limits are a convex set, so the exact extrema of the series say by how much.
    """
    scale = 1.0
    for (low, high), (low_x, high_x), middle in zip(
        problem.limits, ranges(series), (problem.centre[0], 0.0, 0.0), strict=True
    ):
        scale = max(scale, (high_x - middle) / (high - middle), (low_x - middle) / (low - middle))
    if scale == 1.0:
        return series
    shrunk = (series.x - problem.centre) / (scale * (1 + MARGIN))
    return Fourier.of(problem.centre + shrunk, series.period)
