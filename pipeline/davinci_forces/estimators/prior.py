"""Least squares drawn towards a first guess, as far as the data leave parameters open."""

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression, spread
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Triangle

NAME = "least squares with a prior"
STRENGTHS = np.geomspace(1e-32, 1e3, 141)  # lambda, beside columns of unit length


def estimate(problem: Regression) -> Estimate:
    """theta = arg min |tau - Phi theta|^2 + lambda |(theta - theta_0) / d|^2.

    theta_0 is what the robot's tables say, and d its size, so that every parameter is drawn by how far it is off in
    proportion.  Where there is no guess, or one of 0, d is what would make the whole effort by itself.  lambda is the
    one under which the data are most likely where parameters scatter around theta_0 by one variance and the effort
    around Phi theta by another (MacKay, 1992).  The standard errors are those of least squares: they leave out what the
    guess adds.
    """
    weight, R = problem.weight, problem.triangle
    guess = np.zeros(len(R.y)) if problem.known.guess is None else problem.known.guess
    theta = drawn(R, guess, int(np.count_nonzero(weight)))
    return Estimate(theta, lambda: spread(problem, weight, R, theta))


def drawn(R: Triangle, guess: Array, K: int) -> Array:
    """The parameters (p,) under the most likely strength of the penalty."""
    d = np.where(guess != 0, np.abs(guess), np.linalg.norm(R.y) / R.scale)
    A, size, B = np.linalg.svd(R.U * (R.scale * d))
    along = A.T @ (R.y - R.U @ (guess * R.scale))
    strength = STRENGTHS * float(size @ size)
    share = 1.0 + size**2 / strength[:, None]
    squares = (along**2 / share).sum(axis=1) + R.squares
    unlikely = K * np.log(np.maximum(squares, np.finfo(float).tiny)) + np.log(share).sum(axis=1)
    best = strength[int(unlikely.argmin())]
    return np.asarray(guess + d * (B.T @ (size / (size**2 + best) * along)))
