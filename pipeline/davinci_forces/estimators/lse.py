"""Least squares: each averaged sample has the weight of its number of periods."""

from davinci_forces.estimators.problem import Estimate, Regression, standard_errors

NAME = "least squares"


def estimate(problem: Regression) -> Estimate:
    """theta = (Phi' W Phi)^-1 Phi' W tau, W the number of periods, by QR of the weighted rows.  (6.46), (6.50)

    The standard errors scale with the residuals, so a model that does not fit has larger ones than noise.
    """
    theta = problem.triangle.theta
    return Estimate(theta, lambda: standard_errors(problem, theta))
