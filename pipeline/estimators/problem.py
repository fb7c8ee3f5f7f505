"""What every estimator is asked, and what it answers."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import NotIdentifiable
from pipeline.maths.arrays import Array


@dataclass(frozen=True, eq=False)
class Regression:
    """Find theta with Phi theta close to tau: K samples, p parameters, one averaged period of each log in turn."""

    Phi: Array  # (K, p)
    tau: Array  # (K,)
    tau_var: Array  # (K,) variance of one period at each sample
    periods: NDArray[np.int64]  # (K,) how many periods each sample is the mean of, M; 0 where none was recorded
    starts: tuple[int, ...]  # where each log begins
    names: tuple[str, ...]  # of the parameters


class Estimate(NamedTuple):
    """Parameters with two standard deviations: residuals taken as uncorrelated, and allowed to be correlated."""

    theta: Array  # (p,)
    theta_std: Array  # (p,)
    theta_std_hac: Array  # (p,)
    hac_lags: int


Estimator = Callable[[Regression], Estimate]


def solve(problem: Regression, weight: Array) -> Estimate:
    """Minimise the sum of weight (tau - Phi theta)^2, by QR of the scaled rows.  (6.42), (6.46)

    `weight` is (K,), 0 where there is nothing.  The standard deviations take their scale from the residuals, so a
    model that does not fit has wider ones, whatever the noise.

    Raises
    ------
    NotIdentifiable
        If the columns of Phi are linearly dependent, there are no more samples than parameters, or the effort does
        not vary.
    """
    K, p = int((weight > 0).sum()), problem.Phi.shape[1]
    if not np.ptp(problem.tau) > 0:
        raise NotIdentifiable("the effort is the same throughout: check its channel")
    root = np.sqrt(weight)[:, None]
    scale = np.linalg.norm(problem.Phi * root, axis=0)
    if p >= K or (scale == 0).any():
        still = [name for name, size in zip(problem.names, scale, strict=True) if size == 0]
        raise NotIdentifiable(f"{K} samples for {p} parameters; nothing in the motion excites {still or 'them'}")
    F, z = problem.Phi * root / scale, problem.tau * root[:, 0]
    Q, R = np.linalg.qr(F)
    condition = np.linalg.cond(R)
    if condition > 1e8:
        raise NotIdentifiable(
            f"the motion does not tell {', '.join(problem.names)} apart: "
            f"condition number {condition:.1e} of scaled columns"
        )
    scaled = np.linalg.solve(R, Q.T @ z)
    bread = np.linalg.inv(R.T @ R)
    residual = z - F @ scaled
    variance = residual @ residual / (K - p)
    lags = correlation_lags(residual, problem.starts)
    hac = _newey_west(F, residual, bread, problem.starts, lags)
    return Estimate(
        theta=scaled / scale,
        theta_std=np.sqrt(variance * np.diag(bread)) / scale,
        theta_std_hac=np.sqrt(np.diag(hac)) / scale,
        hac_lags=lags,
    )


def correlation_lags(residual: Array, starts: tuple[int, ...]) -> int:
    """How many lags of correlation to allow for, from the residuals' first autocorrelation.

    The bandwidth for a Bartlett window under a first-order autoregression.  (D. Andrews, 1991, (6.2), (6.4))
    """
    parts = np.split(residual, starts[1:])
    first = sum(float(x[1:] @ x[:-1]) for x in parts) / max(float(residual @ residual), 1e-300)
    rho = float(np.clip(first, -0.97, 0.97))
    alpha = 4 * rho**2 / ((1 - rho) ** 2 * (1 + rho) ** 2)
    return min(int(np.ceil(1.1447 * (alpha * len(residual)) ** (1 / 3))), min(map(len, parts)) // 3)


def _newey_west(F: Array, residual: Array, bread: Array, starts: tuple[int, ...], lags: int) -> Array:
    """The covariance that allows for residuals correlated over `lags` samples, log by log."""
    meat = sum(bartlett(part, lags) for part in np.split(F * residual[:, None], starts[1:]))
    K, p = int(F.any(axis=1).sum()), F.shape[1]
    return np.asarray(bread @ meat @ bread * K / (K - p))


def bartlett(scores: Array, lags: int) -> Array:
    """The sum (p, p) of the autocovariances of scores (K, p) under a Bartlett window that ends after so many lags.

    That window is the autocorrelation of a box, so the sum is that of the squares of moving sums, however many lags.
    """
    K = len(scores)
    total = np.vstack([np.zeros_like(scores[:1]), np.cumsum(scores, axis=0)])
    ends = np.arange(1, K + lags + 1)
    moving = total[np.minimum(ends, K)] - total[np.maximum(ends - lags - 1, 0)]
    return np.asarray(moving.T @ moving / (lags + 1))
