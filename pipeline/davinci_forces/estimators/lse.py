"""Least squares: every averaged sample counts as much as the periods behind it."""

from davinci_forces.estimators.problem import Estimate, Regression, spread

NAME = "least squares"


def estimate(problem: Regression) -> Estimate:
    """theta = (Phi' W Phi)^-1 Phi' W tau, W the number of periods, by QR of the weighted rows.  (6.46), (6.50)

    The standard errors take their scale from the residuals, so a model that does not fit has wider ones, whatever the
    noise.
    """
    weight, R = problem.weight, problem.triangle
    return Estimate(R.theta, lambda: spread(problem, weight, R, R.theta))
