"""What every estimator is asked, and what it answers."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import NotIdentifiable
from pipeline.maths.arrays import Array
from pipeline.maths.estimation.correlation import correlated
from pipeline.maths.estimation.least_squares import Triangle, triangle

ROUNDING = 1e-13  # of the longest column, below which one is nothing but rounding
CONDITION = 1e10  # of scaled columns, above which rounding tells them apart as much as the motion does


@dataclass(frozen=True, eq=False)
class Regression:
    """Find theta with Phi theta close to tau: K samples, p parameters, one averaged period of each log in turn."""

    Phi: Array  # (K, p)
    tau: Array  # (K,)
    tau_var: Array  # (K,) variance of one period at each sample
    periods: NDArray[np.int64]  # (K,) how many periods each sample is the mean of, M; 0 where none was recorded
    starts: tuple[int, ...]  # where each log begins
    names: tuple[str, ...]  # of the parameters


class Spread(NamedTuple):
    """How far parameters may be off."""

    classical: Array  # (p,) standard errors, residuals taken as uncorrelated and as large everywhere
    stated: Array  # (p,) allowing for residuals that are neither
    lags: float  # the sum of the residuals' correlations over all lags but 0


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters with two standard errors, which are computed when they are first asked for: refits do not ask."""

    theta: Array  # (p,)
    judge: Callable[[], Spread]

    @cached_property
    def spread(self) -> Spread:
        """How far the parameters may be off."""
        return self.judge()

    @property
    def theta_std(self) -> Array:
        """Standard errors (p,) that take residuals as uncorrelated and as large everywhere."""
        return self.spread.classical

    @property
    def theta_std_hac(self) -> Array:
        """Standard errors (p,) that allow for residuals that are correlated, and larger here than there."""
        return self.spread.stated

    @property
    def hac_lags(self) -> int:
        """Over how many lags residuals are correlated, each counting by its correlation."""
        return round(self.spread.lags)


Estimator = Callable[[Regression], Estimate]


def solve(problem: Regression, weight: Array) -> Estimate:
    """Minimise the sum of weight (tau - Phi theta)^2, by QR of the weighted rows.  (6.42), (6.46)

    `weight` is (K,), 0 where there is nothing.  The standard errors take their scale from the residuals, so a model
    that does not fit has wider ones, whatever the noise.  Raises what `factored` does.
    """
    R = factored(problem, weight)
    return Estimate(R.theta, lambda: spread(problem, weight, R, R.theta))


def factored(problem: Regression, weight: Array) -> Triangle:
    """What the rows, each counting by its weight (K,), say of the parameters.

    Raises
    ------
    NotIdentifiable
        If a weight or a sample is not a number, the effort does not vary, there are no more samples than parameters, or
        the columns of Phi are linearly dependent.
    """
    K, p = int((weight > 0).sum()), problem.Phi.shape[1]
    for what, column in (("weight", weight), ("effort", problem.tau), ("motion", problem.Phi)):
        if not np.isfinite(column).all() or (column is weight and (column < 0).any()):
            row = int(np.argwhere(~np.isfinite(column) | ((column is weight) & (column < 0)))[0, 0])
            raise NotIdentifiable(f"the {what} of sample {row} of {len(problem.tau)} is not a number to fit to")
    if not np.ptp(problem.tau) > 0:
        raise NotIdentifiable("the effort is the same throughout: check its channel")
    if p >= K:
        raise NotIdentifiable(f"{K} samples for {p} parameters: record more of the motion")
    R = triangle(problem.Phi, problem.tau, weight)
    still = [name for name, size in zip(problem.names, R.scale, strict=True) if size <= ROUNDING * R.scale.max()]
    if still:
        raise NotIdentifiable(f"nothing in the motion excites {', '.join(still)}")
    if (condition := np.linalg.cond(R.U)) > CONDITION:
        raise NotIdentifiable(
            f"the motion does not tell {', '.join(problem.names)} apart: "
            f"condition number {condition:.1e} of scaled columns"
        )
    return R


def spread(problem: Regression, weight: Array, R: Triangle, theta: Array) -> Spread:
    """The standard errors of parameters that are those of least squares, or close to them."""
    inverse = np.linalg.inv(R.U)
    root = np.sqrt(weight)
    Q = problem.Phi * root[:, None] @ (inverse / R.scale[:, None])
    residual = root * (problem.tau - problem.Phi @ theta)
    degrees = int((weight > 0).sum()) - len(theta)
    classical = np.sqrt(residual @ residual / degrees * (inverse**2).sum(axis=1)) / R.scale
    found = correlated(Q, residual, problem.starts, inverse / R.scale[:, None], degrees)
    return Spread(classical, np.sqrt(found.variance), found.lags)
