"""Least squares with inertia and friction that are not negative."""

from davinci_forces.estimators.problem import Estimate, Regression, standard_errors
from davinci_forces.maths.estimation.least_squares import solve_bounded

NAME = "bounded least squares"


def estimate(problem: Regression) -> Estimate:
    """theta = arg min |tau - Phi theta|^2 with theta_i >= 0 if physics requires it; the global minimum.

    The standard errors are those of least squares, which are too large for a parameter at its bound.
    """
    theta = solve_bounded(problem.triangle, problem.known.signs(len(problem.names)))
    return Estimate(theta, lambda: standard_errors(problem, theta))
