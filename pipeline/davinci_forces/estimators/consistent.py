"""Least squares among the parameters that a mechanism can have: no negative mass, inertia or friction.

Sousa and Cortesao, 2014 and 2019; Traversaro, Brossette, Escande and Nori, 2016; Wensing, Kim and Slotine, 2018.
"""

from davinci_forces.estimators.problem import Estimate, Regression, standard_errors
from davinci_forces.maths.estimation.conic import nearest
from davinci_forces.maths.models.model import of_signs

NAME = "physically consistent least squares"


def estimate(problem: Regression) -> Estimate:
    """theta = arg min |tau - Phi theta|^2 over the parameters of mechanisms; over signs for a joint without bodies.

    The standard errors are those of least squares.  If no constraint is active, both estimates are equal.  If one is
    active, the effort errs less than that of least squares, because projections onto a convex set are no further apart
    than their points.  The stated error of a parameter at its bound is too large.

    Raises NotIdentifiable if the conic program is not solved, or if least squares raise this error.
    """
    R = problem.triangle
    theta = nearest(R, of_signs(problem.known.signs(len(R.y)))).theta
    return Estimate(theta, lambda: standard_errors(problem, R.theta))
