"""Weighted least squares: samples at which the periods differ more have less weight."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimate, Regression, standard_errors
from davinci_forces.maths.arrays import Array

NAME = "weighted least squares"
MIN_PERIODS = 4  # fewer periods do not determine their variance
DEGREES = 200  # degrees of freedom of each weight, which give it an uncertainty of 10 %
MIN_EXCESS_Z = 3.0  # [standard errors] least excess of the residuals over the noise that is the model's error
MIN_EXCESS_SHARE = 0.05  # the same as a share of the noise: the pooled variance is not known better


def estimate(problem: Regression) -> Estimate:
    """theta = (Phi' W Phi)^-1 Phi' W tau, with W the inverse variance of the averaged effort.  (6.49), corrected

    The variance between M periods at one sample has M - 1 degrees of freedom; weights of its inverse are so uncertain
    that they do worse than none.  The variance is pooled over neighbouring samples until each weight has
    `DEGREES` degrees of freedom.  The variance of the mean is that of one period over M.  If the residuals exceed the
    noise, a constant variance of the model's error is added to all samples, so that weights become more equal.  Without
    it, the weights would favour samples of little noise, at which the model errs as much as at all others.

    Raises NotIdentifiable if a log has fewer than `MIN_PERIODS` periods.
    """
    fewest = min(median_periods(M) for M in np.split(problem.periods, problem.starts[1:]))
    if fewest < MIN_PERIODS:
        raise NotIdentifiable(f"weights need at least {MIN_PERIODS} periods in every log, and one holds {fewest}")
    parts = (np.split(column, problem.starts[1:]) for column in (problem.tau_var, problem.periods))
    weight = np.concatenate([M / pool_variance(var, M) for var, M in zip(*parts, strict=True)])
    weighted = replace(problem, weights=weight)
    R, degrees = weighted.triangle, int(np.count_nonzero(problem.periods)) - len(problem.names)
    if R.min_squares > degrees * (1.0 + max(MIN_EXCESS_SHARE, MIN_EXCESS_Z * np.sqrt(2.0 / degrees))):
        weighted = replace(problem, weights=add_model_error(weight, problem.tau - problem.Phi @ R.theta, degrees))
    theta = weighted.triangle.theta
    return Estimate(theta, lambda: standard_errors(weighted, theta))


def add_model_error(weight: Array, residual: Array, degrees: int) -> Array:
    """Add the variance s^2 of the model's error to the weights (K,): 1/w + s^2 in place of 1/w.

    s^2 solves sum of r^2 / (1/w + s^2) = K - p, between 0 and the sum of r^2 / (K - p).  (Paule and Mandel, 1982)
    """
    from scipy.optimize import brentq

    valid = weight > 0
    noise, squares = 1.0 / weight[valid], residual[valid] ** 2
    most = float(squares.sum()) / degrees
    s2 = brentq(lambda s2: float((squares / (noise + s2)).sum()) - degrees, 0.0, most, xtol=1e-14 * most)
    out = np.zeros_like(weight)
    out[valid] = 1.0 / (noise + s2)
    return out


def pool_variance(var: Array, M: NDArray[np.int64]) -> Array:
    """Average the variance (K,) of one period over neighbouring samples that have `DEGREES` degrees of freedom.

    Each sample is weighted by its degrees of freedom, M - 1 for M (K,) periods.  If periods do not differ at all, all
    samples get the same variance.
    """
    from scipy.ndimage import uniform_filter1d

    if not var.any():
        return np.ones(len(var))
    degrees = np.maximum(M[:1] if M.min() == M.max() else M, 1) - 1.0
    half = min(int(np.ceil(DEGREES / max(float(np.median(degrees)), 1.0))) // 2, (len(var) - 1) // 2)
    window = 2 * half + 1  # samples, at most a period, whose end is next to its beginning
    squares, freedom = (uniform_filter1d(x, window, mode="wrap") for x in (var * degrees, degrees))
    smooth = squares / np.maximum(freedom, 1.0 / window)
    return np.asarray(np.maximum(smooth, 1e-12 * var.mean(), out=smooth))


def median_periods(M: NDArray[np.int64]) -> int:
    """Return the median number of periods (K,) over the samples with at least one."""
    return int(M.max()) if M.min() == M.max() else int(np.median(M[M > 0]))
