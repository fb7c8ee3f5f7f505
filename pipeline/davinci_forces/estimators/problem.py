"""What every estimator is asked, and what it answers."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import NotIdentifiable
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.estimation.correlation import correlated
from davinci_forces.maths.estimation.least_squares import Triangle, not_told_apart, triangle
from davinci_forces.maths.models.physical import Box

ROUNDING = 1e-13  # of the longest column, below which one is nothing but rounding
ALIKE = 0.01  # of the square of what the columns tell least, from which on a parameter is named
CONDITION = 1e10  # of scaled columns, above which rounding tells them apart as much as the motion does


class Known(NamedTuple):
    """What is known of p parameters before anything is measured."""

    positive: Booleans | None = None  # (p,) whether physics knows that they are not negative
    box: Box | None = None  # of the physical parameters that they are made of
    guess: Array | None = None  # (p,)

    def signs(self, p: int) -> Booleans:
        """Which of the parameters (p,) are known not to be negative."""
        return np.zeros(p, np.bool_) if self.positive is None else self.positive


NOTHING = Known()


@dataclass(frozen=True, eq=False)
class Regression:
    """Find theta with Phi theta close to tau: K samples, p parameters, one averaged period of each log in turn."""

    Phi: Array  # (K, p)
    tau: Array  # (K,)
    tau_var: Array  # (K,) variance of one period at each sample
    periods: NDArray[np.int64]  # (K,) how many periods each sample is the mean of, M; 0 where none was recorded
    starts: tuple[int, ...]  # where each log begins
    names: tuple[str, ...]  # of the parameters
    known: Known = NOTHING
    Phi_cov: Array | None = None  # (S, p, p) covariance of the errors of a row, the mean over each log; None: not known

    @cached_property
    def weight(self) -> Array:
        """By what each sample (K,) counts where all periods count the same."""
        return self.periods.astype(float)

    @cached_property
    def triangle(self) -> Triangle:
        """What the samples say of the parameters where all periods count the same.  Raises what `factored` does."""
        return factored(self, self.weight)


class Spread(NamedTuple):
    """How far parameters may be off."""

    classical: Array  # (p,) standard errors, residuals taken as uncorrelated and as large everywhere
    stated: Array  # (p,) allowing for residuals that are neither
    lags: float  # the sum of the residuals' correlations over all lags but 0


class Search(NamedTuple):
    """A search for parameters, and how it went."""

    walls: str  # what they did to particles
    seed: int
    particles: int
    searched: int  # parameters, n
    swarms: int
    excess: float  # of the squared error over the least that the known signs allow, as a share of it
    history: Array  # (I,) mean squared error after each iteration
    theta: Array  # (p,)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters; standard errors and searches are computed when they are first asked for, which refits never do."""

    theta: Array  # (p,)
    judge: Callable[[], Spread]
    look: Callable[[], tuple[Search, ...]] = tuple

    @cached_property
    def spread(self) -> Spread:
        """How far the parameters may be off."""
        return self.judge()

    @property
    def searches(self) -> tuple[Search, ...]:
        """How the parameters were searched for, and how others would have been."""
        return self.look()

    @property
    def theta_std_classical(self) -> Array:
        """Standard errors (p,) that take residuals as uncorrelated and as large everywhere."""
        return self.spread.classical

    @property
    def theta_std(self) -> Array:
        """Standard errors (p,) that allow for residuals that are correlated, and larger here than there."""
        return self.spread.stated

    @property
    def correlated_lags(self) -> int:
        """Over how many lags residuals are correlated, each counting by its correlation."""
        return round(self.spread.lags)


Estimator = Callable[[Regression], Estimate]


def factored(problem: Regression, weight: Array) -> Triangle:
    """What the rows, each counting by its weight (K,), 0 where there is nothing, say of the parameters.  (6.42)

    Raises
    ------
    NotIdentifiable
        If a weight or a sample is not a number, the effort does not vary, there are no more samples than parameters, or
        the columns of Phi are linearly dependent.
    """
    K, p = int(np.count_nonzero(weight)), problem.Phi.shape[1]
    if p >= K:
        raise NotIdentifiable(f"{K} samples for {p} parameters: record more of the motion")
    if np.ptp(problem.tau) == 0:
        raise NotIdentifiable("the effort is the same throughout: check its channel")
    R = triangle(problem.Phi, problem.tau, weight)
    if not np.isfinite(R.squares):
        columns = {"weight": np.where(weight >= 0, weight, np.nan), "effort": problem.tau, "motion": problem.Phi.sum(1)}
        what, row = next((name, np.argmin(np.isfinite(x))) for name, x in columns.items() if not np.isfinite(x).all())
        raise NotIdentifiable(
            f"the {what} of sample {row + 1} of {len(problem.tau)} is not a number: check its channel"
        )
    still = [name for name, size in zip(problem.names, R.scale, strict=True) if size <= ROUNDING * R.scale.max()]
    if still:
        raise NotIdentifiable(f"nothing in the motion excites {', '.join(still)}")
    if (condition := np.linalg.cond(R.U)) > CONDITION:
        alike = ", ".join(problem.names[i] for i in not_told_apart(R.U, ALIKE))
        raise NotIdentifiable(
            f"the motion does not tell {alike} apart: condition number {condition:.1e} of scaled columns"
        )
    return R


def spread_by(problem: Regression, weight: Array, theta: Array, Q: Array, D: Array) -> Spread:
    """The standard errors of parameters theta = D Q' tau (p,), of orthonormal columns Q (K, p) and D (p, p)."""
    residual = np.sqrt(weight) * (problem.tau - problem.Phi @ theta)
    degrees = int((weight > 0).sum()) - len(theta)
    classical = np.sqrt(residual @ residual / degrees * (D**2).sum(axis=1))
    found = correlated(Q, residual, problem.starts, D, degrees)
    return Spread(classical, np.sqrt(found.variance), found.lags)


def spread(problem: Regression, weight: Array, R: Triangle, theta: Array, residual: Array | None = None) -> Spread:
    """The standard errors of parameters that are those of least squares, or close to them.

    They come from the weighted residuals, or from others (K,) that stand in for them.
    """
    inverse = np.linalg.inv(R.U)
    root = np.sqrt(weight)
    Q = ((inverse.T / R.scale) @ problem.Phi.T).T  # each column in one piece, as its transform wants it
    Q *= root[:, None]
    if residual is None:
        residual = root * (problem.tau - problem.Phi @ theta)
    degrees = int((weight > 0).sum()) - len(theta)
    classical = np.sqrt(residual @ residual / degrees * (inverse**2).sum(axis=1)) / R.scale
    found = correlated(Q, residual, problem.starts, inverse / R.scale[:, None], degrees)
    return Spread(classical, np.sqrt(found.variance), found.lags)
