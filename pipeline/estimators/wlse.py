"""Weighted least squares: samples where the periods disagree count less."""

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import NotIdentifiable
from pipeline.estimators.problem import Answer, Problem, solve

Array = NDArray[np.float64]

FEWEST = 4  # periods: fewer say too little about their own spread
DEGREES = 200  # degrees of freedom behind each weight, which leave it uncertain by 10 %


def estimate(problem: Problem) -> Answer:
    """theta = (Phi' W Phi)^-1 Phi' W tau, with W the inverse variance of the averaged effort.  (6.49), corrected

    The variance between M periods at one sample has M - 1 degrees of freedom; weights of its inverse are so uncertain
    that they do worse than none.  It is therefore pooled over neighbouring samples of the period until `DEGREES`
    degrees of freedom stand behind every weight.  The variance of the mean is that of one period over M.

    Raises
    ------
    NotIdentifiable
        If a log holds fewer than `FEWEST` periods.
    """
    fewest = int(problem.periods.min())
    if fewest < FEWEST:
        raise NotIdentifiable(f"weights need at least {FEWEST} periods in every log, and one holds {fewest}")
    parts = zip(
        np.split(problem.tau_var, problem.starts[1:]), np.split(problem.periods, problem.starts[1:]), strict=True
    )
    variance = np.concatenate([pooled(var, int(M[0])) / M[0] for var, M in parts])
    return solve(problem, 1.0 / variance)


def pooled(var: Array, periods: int) -> Array:
    """The variance (K,) averaged around the period, over as many samples as `DEGREES` degrees of freedom need."""
    K = len(var)
    reach = min(int(np.ceil(DEGREES / (periods - 1))) // 2, (K - 1) // 2)
    around = np.concatenate([var[K - reach :], var, var[:reach]])
    total = np.cumsum(np.concatenate([[0.0], around]))
    smooth = (total[2 * reach + 1 :] - total[: -2 * reach - 1]) / (2 * reach + 1)
    return np.asarray(np.maximum(smooth, 1e-12 * var.mean() + 1e-300))
