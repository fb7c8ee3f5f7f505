"""Weighted least squares: samples where the periods disagree count less, as far as noise is what the model leaves."""

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimate, Regression, factored, spread
from davinci_forces.maths.arrays import Array

NAME = "weighted least squares"
FEWEST = 4  # periods: fewer say too little about their own spread
DEGREES = 200  # degrees of freedom behind each weight, which leave it uncertain by 10 %
CLEARLY = 3.0  # standard errors by which residuals have to exceed the noise,
WORTH = 0.05  # and share of it: the pooled variance itself is not known better
STEPS = 100


def estimate(problem: Regression) -> Estimate:
    """theta = (Phi' W Phi)^-1 Phi' W tau, with W the inverse variance of the averaged effort.  (6.49), corrected

    The variance between M periods at one sample has M - 1 degrees of freedom; weights of its inverse are so uncertain
    that they do worse than none.  It is therefore pooled over neighbouring samples of the period until `DEGREES`
    degrees of freedom stand behind every weight.  The variance of the mean is that of one period over M.  Where a model
    leaves more than noise, its error has a variance of its own, the same everywhere, which makes weights more equal:
    they would trust quiet samples, at which the model errs as it does at loud ones.

    Raises
    ------
    NotIdentifiable
        If a log holds fewer than `FEWEST` periods.
    """
    fewest = min(usual(M) for M in np.split(problem.periods, problem.starts[1:]))
    if fewest < FEWEST:
        raise NotIdentifiable(f"weights need at least {FEWEST} periods in every log, and one holds {fewest}")
    parts = (np.split(column, problem.starts[1:]) for column in (problem.tau_var, problem.periods))
    weight = np.concatenate([M / pooled(var, M) for var, M in zip(*parts, strict=True)])
    R = factored(problem, weight)
    degrees = int(np.count_nonzero(problem.periods)) - len(R.y)
    if R.squares > degrees * (1.0 + max(WORTH, CLEARLY * np.sqrt(2.0 / degrees))):
        weight = shrunk(weight, problem.tau - problem.Phi @ R.theta, degrees)
        R = factored(problem, weight)
    return Estimate(R.theta, lambda: spread(problem, weight, R, R.theta))


def shrunk(weight: Array, residual: Array, degrees: int) -> Array:
    """Weights (K,) that allow for the model's error: 1/w + s^2 in place of 1/w, so that they sum to the degrees.

    f = sum of r^2 / (1/w + s^2) = K - p.  (Paule and Mandel, 1982)  Newton's method on 1/f, which is concave in s^2 and
    a straight line where 1/w is the same everywhere, gets there from below.
    """
    seen = weight > 0
    noise, squares, s2 = 1.0 / weight[seen], residual[seen] ** 2, 0.0
    for _ in range(STEPS):
        share = squares / (noise + s2)
        f = float(share.sum())
        step = f / degrees * (f - degrees) / float((share / (noise + s2)).sum())
        s2 += step
        if step <= 1e-12 * s2:
            break
    out = np.zeros_like(weight)
    out[seen] = 1.0 / (noise + s2)
    return out


def pooled(var: Array, M: NDArray[np.int64]) -> Array:
    """The variance (K,) of one period averaged around the period, over as many samples as `DEGREES` degrees need.

    Each sample counts by its degrees of freedom, one less than the M (K,) periods that it is the mean of.  Where
    periods do not differ at all, every sample is as good as any other.
    """
    K, least, most = len(var), max(int(M.min()) - 1, 0), max(int(M.max()) - 1, 0)
    if least == most:
        reach = reach_of(least, K)
        smooth = around(var, reach)
        smooth /= 2 * reach + 1
    else:
        degrees = np.maximum(M - 1, 0).astype(float)
        reach = reach_of(float(np.median(degrees)), K)
        smooth = around(var * degrees, reach) / np.maximum(around(degrees, reach), 1.0)
    return np.asarray(np.maximum(smooth, 1e-12 * var.mean(), out=smooth)) if var.any() else np.ones(K)


def reach_of(degrees: float, K: int) -> int:
    """How many samples on either side have `DEGREES` degrees of freedom together, so many each; at most the period."""
    return min(int(np.ceil(DEGREES / max(degrees, 1.0))) // 2, (K - 1) // 2)


def usual(M: NDArray[np.int64]) -> int:
    """The median of periods (K,), of which most logs have one number, where there are any."""
    return int(M[0]) if M.min() == M.max() else int(np.median(M[M > 0]))


def around(x: Array, reach: int) -> Array:
    """The sum (K,) of each sample and its neighbours, the last being next to the first."""
    K = len(x)
    total = np.empty(K + 2 * reach + 1)
    total[0] = 0.0
    total[1 : reach + 1], total[reach + 1 : reach + 1 + K], total[reach + 1 + K :] = x[K - reach :], x, x[:reach]
    np.cumsum(total, out=total)
    return np.asarray(total[2 * reach + 1 :] - total[:K])
