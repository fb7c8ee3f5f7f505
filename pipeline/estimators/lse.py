"""Least squares: every averaged sample counts as much as the periods behind it."""

from pipeline.estimators.problem import Estimate, Regression, solve


def estimate(problem: Regression) -> Estimate:
    """theta = (Phi' Phi)^-1 Phi' tau, solved by QR.  (6.50)"""
    return solve(problem, problem.periods.astype(float))
