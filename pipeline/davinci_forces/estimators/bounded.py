"""Least squares with inertia and friction that are not negative, as no mechanism's are."""

from davinci_forces.estimators.problem import Estimate, Regression, spread
from davinci_forces.maths.estimation import least_squares

NAME = "bounded least squares"


def estimate(problem: Regression) -> Estimate:
    """theta = arg min |tau - Phi theta|^2 with theta_i >= 0 where physics knows the sign; the global minimum.

    The standard errors are those of least squares: of a parameter that a bound holds back, they are too large.
    """
    weight, R = problem.weight, problem.triangle
    theta = least_squares.bounded(R, problem.known.signs(len(R.y)))
    return Estimate(theta, lambda: spread(problem, weight, R, theta))
