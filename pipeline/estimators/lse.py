"""Least squares: every averaged sample counts as much as the periods behind it."""

from pipeline.estimators.problem import Answer, Problem, solve


def estimate(problem: Problem) -> Answer:
    """theta = (Phi' Phi)^-1 Phi' tau, solved by QR.  (6.50)"""
    return solve(problem, problem.periods.astype(float))
