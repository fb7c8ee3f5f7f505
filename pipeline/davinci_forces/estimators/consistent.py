"""Least squares among the parameters that a mechanism can have: no negative mass, inertia or friction.

Sousa and Cortesao, 2014 and 2019; Traversaro, Brossette, Escande and Nori, 2016; Wensing, Kim and Slotine, 2018.
"""

from davinci_forces.estimators.problem import Estimate, Regression, spread
from davinci_forces.maths.estimation.conic import nearest
from davinci_forces.maths.models.model import of_signs

NAME = "physically consistent least squares"


def estimate(problem: Regression) -> Estimate:
    """theta = arg min |tau - Phi theta|^2 among what some mechanism has; of a joint without bodies, signs alone.

    The standard errors are those of least squares.  Where parameters are not held back they are the same.  Where they
    are, the effort that they make errs less than least squares', because what is nearest to two points in a convex set
    is no further apart than these; of the parameter that a bound holds the stated error is too large.

    Raises
    ------
    NotIdentifiable
        If the conic program is not solved, and where least squares raise it.
    """
    weight, R = problem.weight, problem.triangle
    theta = nearest(R, of_signs(problem.known.signs(len(R.y)))).theta
    return Estimate(theta, lambda: spread(problem, weight, R, R.theta))
