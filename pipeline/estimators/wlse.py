"""Weighted least squares: samples where the periods disagree count less."""

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import NotIdentifiable
from pipeline.estimators.problem import Estimate, Regression, solve
from pipeline.maths.arrays import Array

FEWEST = 4  # periods: fewer say too little about their own spread
DEGREES = 200  # degrees of freedom behind each weight, which leave it uncertain by 10 %


def estimate(problem: Regression) -> Estimate:
    """theta = (Phi' W Phi)^-1 Phi' W tau, with W the inverse variance of the averaged effort.  (6.49), corrected

    The variance between M periods at one sample has M - 1 degrees of freedom; weights of its inverse are so uncertain
    that they do worse than none.  It is therefore pooled over neighbouring samples of the period until `DEGREES`
    degrees of freedom stand behind every weight.  The variance of the mean is that of one period over M.

    Raises
    ------
    NotIdentifiable
        If a log holds fewer than `FEWEST` periods.
    """
    fewest = min(int(np.median(M)) for M in np.split(problem.periods, problem.starts[1:]))
    if fewest < FEWEST:
        raise NotIdentifiable(f"weights need at least {FEWEST} periods in every log, and one holds {fewest}")
    parts = (np.split(column, problem.starts[1:]) for column in (problem.tau_var, problem.periods))
    return solve(problem, np.concatenate([M / pooled(var, M) for var, M in zip(*parts, strict=True)]))


def pooled(var: Array, M: NDArray[np.int64]) -> Array:
    """The variance (K,) of one period averaged around the period, over as many samples as `DEGREES` degrees need.

    Each sample counts by its degrees of freedom, one less than the M (K,) periods that it is the mean of.
    """
    K, degrees = len(var), np.maximum(M - 1, 0).astype(float)
    reach = min(int(np.ceil(DEGREES / max(float(np.median(degrees)), 1.0))) // 2, (K - 1) // 2)
    smooth = around(var * degrees, reach) / np.maximum(around(degrees, reach), 1.0)
    return np.asarray(np.maximum(smooth, 1e-12 * var.mean() + 1e-300))


def around(x: Array, reach: int) -> Array:
    """The sum (K,) of each sample and its neighbours, the last being next to the first."""
    K = len(x)
    total = np.cumsum(np.concatenate([[0.0], x[K - reach :], x, x[:reach]]))
    return np.asarray(total[2 * reach + 1 :] - total[:K])
