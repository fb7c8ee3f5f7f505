"""Least squares with a prior: parameters that the data do not determine stay near a first guess."""

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression, standard_errors

NAME = "least squares with a prior"
STRENGTHS = np.geomspace(1e-32, 1e3, 141)  # lambda, for columns of unit length


def estimate(problem: Regression) -> Estimate:
    """theta = arg min |tau - Phi theta|^2 + lambda |(theta - theta_0) / d|^2.

    theta_0 comes from the robot's tables, and d = |theta_0|, so the penalty is on relative deviations.  Without a
    guess, or with a guess of 0, d is the parameter that alone would cause the whole effort.  lambda maximises the
    likelihood of the data, with one variance of the parameters around theta_0 and one of the effort around Phi theta
    (MacKay, 1992).  The standard errors are those of least squares, without the information of the guess.
    """
    R, K = problem.triangle, int(np.count_nonzero(problem.weight))
    guess = np.zeros(len(R.y)) if problem.known.guess is None else problem.known.guess
    d = np.where(guess != 0, np.abs(guess), np.linalg.norm(R.y) / R.scale)
    A, size, B = np.linalg.svd(R.U * (R.scale * d))
    along = A.T @ (R.y - R.U @ (guess * R.scale))
    strength = STRENGTHS * float(size @ size)
    share = 1.0 + size**2 / strength[:, None]
    squares = (along**2 / share).sum(axis=1) + R.min_squares
    cost = K * np.log(np.maximum(squares, np.finfo(float).tiny)) + np.log(share).sum(axis=1)
    best = strength[int(cost.argmin())]
    theta = np.asarray(guess + d * (B.T @ (size / (size**2 + best) * along)))
    return Estimate(theta, lambda: standard_errors(problem, theta))
