"""The input and the output of every estimator."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import NotIdentifiable
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.estimation.correlation import correlated_variance
from davinci_forces.maths.estimation.least_squares import Triangle, dependent_parameters, triangle
from davinci_forces.maths.models.physical import Box

ROUNDING = 1e-13  # a column with a smaller share of the longest column is only rounding
MIN_PART_NAMED = 0.01  # a parameter is named from this share in the square of the least certain combination on
MAX_CONDITION = 1e10  # with a larger one, rounding separates the scaled columns as much as the motion does


class Prior(NamedTuple):
    """Prior knowledge of p parameters."""

    positive: Booleans | None = None  # (p,) whether physics requires a parameter not to be negative
    box: Box | None = None  # of the physical parameters that make up these p
    guess: Array | None = None  # (p,)

    def signs(self, p: int) -> Booleans:
        """Return which of the parameters (p,) are known not to be negative."""
        return np.zeros(p, np.bool_) if self.positive is None else self.positive


NO_PRIOR = Prior()
ROWS = ("Phi", "tau", "tau_var", "periods", "noise")  # fields of a regression with one entry a sample


@dataclass(frozen=True, eq=False)
class Regression:
    """Fit Phi theta to tau: K samples, p parameters, one averaged period of each log in turn."""

    Phi: Array  # (K, p)
    tau: Array  # (K,)
    tau_var: Array  # (K,) variance of one period at each sample
    periods: NDArray[np.int64]  # (K,) number of periods M in each averaged sample; 0 if none was recorded
    starts: tuple[int, ...]  # where each log begins
    names: tuple[str, ...]  # of the parameters
    known: Prior = NO_PRIOR
    noise: Array | None = None  # (K,) noise like that of tau, without the motion; None: the residual is taken for it
    model_std: Array | float = 0.0  # (p,) standard errors of the parameters due to the model
    Phi_cov: Array | None = None  # (S, p, p) mean covariance of a row's errors in each log; None: not known
    weights: Array | None = None  # (K,) of the samples; None: all periods have the same weight

    @cached_property
    def weight(self) -> Array:
        """The weight of each sample (K,)."""
        return self.periods.astype(float) if self.weights is None else self.weights

    @cached_property
    def triangle(self) -> Triangle:
        """The QR factors of the weighted samples.  Raises the errors of `factorise`."""
        return factorise(self, self.weight)


class StandardErrors(NamedTuple):
    """Standard errors of parameters."""

    classical: Array  # (p,) standard errors for residuals that are uncorrelated and of equal variance
    noise: Array  # (p,) for noise that is correlated and of varying variance
    model: Array  # (p,)
    lags: float  # over which noise is correlated, each weighted by its correlation

    @property
    def total(self) -> Array:
        """Standard errors (p,) of noise and model together."""
        return np.hypot(self.noise, self.model)


class Search(NamedTuple):
    """A search for parameters, and its course."""

    walls: str  # what happens to particles at the box
    seed: int
    particles: int
    searched: int  # number of parameters, n
    swarms: int
    excess: float  # of the squared error over the smallest one under the known signs, as a share of that
    history: Array  # (I,) mean squared error after each iteration
    theta: Array  # (p,)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters; standard errors and searches are computed where they are used, because refits need neither."""

    theta: Array  # (p,)
    compute_standard_errors: Callable[[], StandardErrors]
    run_searches: Callable[[], tuple[Search, ...]] = tuple  # by every manner of search

    @cached_property
    def standard_errors(self) -> StandardErrors:
        """The standard errors of the parameters."""
        return self.compute_standard_errors()

    @property
    def theta_std(self) -> Array:
        """Standard errors (p,) of noise and model together."""
        return self.standard_errors.total


Estimator = Callable[[Regression], Estimate]


def factorise(problem: Regression, weight: Array) -> Triangle:
    """Compute the QR factors of the weighted rows; weight (K,) is 0 without a sample.  (6.42)

    Raises NotIdentifiable if a weight or a sample is not a number, the effort is constant, there are no more samples
    than parameters, or columns of Phi are linearly dependent.
    """
    K, p = int(np.count_nonzero(weight)), problem.Phi.shape[1]
    if p >= K:
        raise NotIdentifiable(f"{K} samples for {p} parameters: record more of the motion")
    if np.ptp(problem.tau) == 0:
        raise NotIdentifiable("the effort is constant: check its channel")
    R = triangle(problem.Phi, problem.tau, weight)
    if not np.isfinite(R.min_squares):
        columns = {"weight": np.where(weight >= 0, weight, np.nan), "effort": problem.tau, "motion": problem.Phi.sum(1)}
        name, row = next((name, np.argmin(np.isfinite(x))) for name, x in columns.items() if not np.isfinite(x).all())
        sample = f"sample {row + 1} of {len(problem.tau)}"
        raise NotIdentifiable(f"the {name} of {sample} is not a number: check its channel")
    unexcited = [name for name, size in zip(problem.names, R.scale, strict=True) if size <= ROUNDING * R.scale.max()]
    if unexcited:
        raise NotIdentifiable(f"the motion does not excite {', '.join(unexcited)}")
    if (condition := np.linalg.cond(R.U)) > MAX_CONDITION:
        alike = ", ".join(problem.names[i] for i in dependent_parameters(R.U, MIN_PART_NAMED))
        size = f"{condition:.1e} of scaled columns"
        raise NotIdentifiable(f"the motion does not separate {alike}: condition number {size}")
    return R


def standard_errors_by(
    problem: Regression, theta: Array, Q: Array, D: Array, residual: Array | None = None
) -> StandardErrors:
    """Compute the standard errors of theta = D Q' tau (p,), with orthonormal columns Q (K, p), and D (p, p).

    The classical ones follow from the weighted residuals, or from a `residual` (K,) instead.  Those of noise follow
    from the noise of the problem, or from the same residuals if it is not known.
    """
    root = np.sqrt(problem.weight)
    if residual is None:
        residual = root * (problem.tau - problem.Phi @ theta)
    degrees = int((problem.weight > 0).sum()) - len(theta)
    classical = np.sqrt(residual @ residual / degrees * (D**2).sum(axis=1))
    noise = residual if problem.noise is None else root * problem.noise
    variance, lags = correlated_variance(Q, noise, problem.starts, D, degrees)
    return StandardErrors(classical, np.sqrt(variance), np.full(len(theta), problem.model_std), lags)


def standard_errors(problem: Regression, theta: Array, residual: Array | None = None) -> StandardErrors:
    """Compute the standard errors of parameters of least squares, or close to them, as `standard_errors_by` does."""
    R = problem.triangle
    inverse = np.linalg.inv(R.U)
    Q = ((inverse.T / R.scale) @ problem.Phi.T).T  # columns contiguous, for their transform
    Q *= np.sqrt(problem.weight)[:, None]
    return standard_errors_by(problem, theta, Q, inverse / R.scale[:, None], residual)
