"""The trajectory that tells most about a joint, within limits that hold at every instant.  Section 6.3.2"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from pipeline.maths.arrays import Array
from pipeline.maths.excitation.fourier import (
    SAMPLES,
    Fourier,
    Range,
    basis,
    condition,
    determinant,
    instants,
    observation,
    ranges,
    turning_points,
)
from pipeline.maths.models.independent import regressor, slopes
from pipeline.maths.models.terms import Term

Criterion = Callable[[Array], tuple[float, Array]]
CRITERIA: dict[str, Criterion] = {"determinant": determinant, "condition": condition}
GRID = 24  # instants a harmonic at which the limits are asked for first
POLISH = 1500  # random steps around the best of the local optima
EXCHANGES = 4  # times that the instants where a limit was exceeded are added
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


def design(problem: ExcitationProblem, starts: int, seed: int) -> Fourier:
    """The best of several local optima.  (6.27)

    Local searches start from `starts` random trajectories that touch a limit.

    Raises
    ------
    ValueError
        If the limits cannot be kept, or if no trajectory tells the terms apart.
    """
    if reason := impossible(problem.limits):
        raise ValueError(reason)
    random = np.random.default_rng(seed)
    optima = [_local(problem, _start(problem, random)) for _ in range(starts)]
    best = min(optima, key=lambda series: _value(problem, series.x))
    if not np.isfinite(_value(problem, best.x)):
        names = ", ".join(term.name for term in problem.terms)
        raise ValueError(f"no trajectory of {problem.harmonics} harmonics tells the terms {names} apart")
    return polished(problem, best, random)


def polished(problem: ExcitationProblem, series: Fourier, random: np.random.Generator) -> Fourier:
    """A random search around a local optimum, for the jumps of friction at dq = 0, which the gradient does not see.

    Steps grow when they succeed and shrink when they do not.  (I. Rechenberg's one-fifth rule, 1973)
    """
    value = _value(problem, series.x)
    step = 0.02 * float(np.abs(series.x - problem.centre).max())
    for _ in range(POLISH):
        x = series.x + step * random.normal(size=len(series.x))
        candidate = within(problem, Fourier.of(x, problem.period))
        objective = CRITERIA[problem.criterion](observation(problem.terms, candidate, problem.samples))[0]
        better = objective < value
        if better:
            series, value = candidate, objective
        step *= 1.5 if better else 1.5**-0.25
    return series


def within(problem: ExcitationProblem, series: Fourier) -> Fourier:
    """The series shrunk towards standing still until every limit holds at every instant.

    The trajectories within the limits are a convex set, so the exact extrema of the series say by how much.
    """
    scale = 1.0
    for (low, high), (lowest, highest), middle in zip(
        problem.limits, ranges(series), (problem.centre[0], 0.0, 0.0), strict=True
    ):
        scale = max(scale, (highest - middle) / (high - middle), (lowest - middle) / (low - middle))
    if scale == 1.0:
        return series
    shrunk = (series.x - problem.centre) / (scale * (1 + MARGIN))
    return Fourier.of(problem.centre + shrunk, series.period)


def _start(problem: ExcitationProblem, random: np.random.Generator) -> Array:
    x = problem.centre + random.normal(size=1 + 2 * problem.harmonics)
    x[0] = problem.centre[0]
    wild = Fourier.of(1e6 * (x - problem.centre) + problem.centre, problem.period)
    return within(problem, wild).x


def _local(problem: ExcitationProblem, x: Array) -> Fourier:
    times = [instants(problem.period, GRID * problem.harmonics)] * 3
    for _ in range(EXCHANGES):
        kept = LinearConstraint(*inequalities(problem, times))
        options: Any = {"maxiter": 200, "ftol": 1e-10}
        result = minimize(partial(_cost, problem), x, jac=True, method="SLSQP", constraints=[kept], options=options)
        if not np.isfinite(result.x).all() or not np.isfinite(result.fun):
            break
        x = result.x
        series = Fourier.of(x, problem.period)
        times = [np.concatenate([t, more]) for t, more in zip(times, turning_points(series), strict=True)]
    return within(problem, Fourier.of(x, problem.period))


def inequalities(problem: ExcitationProblem, times: Sequence[Array]) -> tuple[Array, Array, Array]:
    """A, b and c of b <= A x <= c: the limits at these instants.  (6.25)"""
    A = [basis(problem.period, problem.harmonics, t)[i] for i, t in enumerate(times)]
    lower, upper = ([np.full(len(t), r[side]) for t, r in zip(times, problem.limits, strict=True)] for side in (0, 1))
    return np.concatenate(A), np.concatenate(lower), np.concatenate(upper)


def _value(problem: ExcitationProblem, x: Array) -> float:
    return _cost(problem, x)[0]


def _cost(problem: ExcitationProblem, x: Array) -> tuple[float, Array]:
    """The criterion and its gradient by x; the jumps of friction at dq = 0 have no derivative and are left out."""
    bases = basis(problem.period, problem.harmonics, instants(problem.period, problem.samples))
    q, dq, ddq = (B @ x for B in bases)
    value, by_F = CRITERIA[problem.criterion](regressor(problem.terms, q, dq, ddq))
    gradient = bases[2].T @ (by_F @ np.array([term.a for term in problem.terms]))
    for B, by_motion in zip(bases[:2], slopes(problem.terms, q, dq), strict=True):
        gradient += B.T @ (by_F * by_motion).sum(axis=1)
    return value, gradient
