"""Least squares by QR factorisation, in one pass over the rows.

    W^(1/2) [Phi D^-1, tau] = Q [[U, y], [0, e]],    |W^(1/2) (tau - Phi theta)|^2 = |U D theta - y|^2 + e^2
    theta = D^-1 U^-1 y,    cov(theta) ~ (Phi' W Phi)^-1,    U = A diag(singular_values) B'

D holds the lengths of the weighted columns, so U has columns of unit length.  The triangular factor U contains all
information of the data for least squares, with or without bounds.  A small singular value means that its column of B is
a combination of parameters that hardly changes the effort, so the data determine this combination badly.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans


class Triangle(NamedTuple):
    """Triangular factor of K weighted rows for p parameters, with the columns scaled to unit length."""

    U: Array  # (p, p) upper triangular
    y: Array  # (p,)
    min_squares: float  # e^2, minimum of the weighted sum of squared residuals
    scale: Array  # (p,) lengths of the weighted columns: the diagonal of D

    @property
    def theta(self) -> Array:
        """Least-squares parameters (p,).  (6.46)"""
        return np.asarray(np.linalg.solve(self.U, self.y) / self.scale)

    def excess(self, theta: Array) -> Array:
        """The weighted sum of squared residuals at parameters theta (..., p), minus its minimum; shape (...)."""
        return np.asarray((((theta * self.scale) @ self.U.T - self.y) ** 2).sum(axis=-1))


def triangle(Phi: Array, tau: Array, weight: Array) -> Triangle:
    """Factor Phi (K, p) and tau (K,), with a weight (K,) of each row; a column of zeros remains zero."""
    from davinci_forces.maths.estimation import kernels

    p = Phi.shape[1]
    R = np.empty((p + 1, p + 1))
    kernels.triangularise(Phi, tau, weight, R)
    scale = np.linalg.norm(R[:, :p], axis=0)
    return Triangle(R[:p, :p] / np.where(scale > 0, scale, 1.0), R[:p, p], float(R[p, p] ** 2), scale)


def solve_bounded(factor: Triangle, positive: Booleans) -> Array:
    """Least-squares parameters (p,), of which those marked in `positive` (p,) are not negative."""
    from scipy.optimize import lsq_linear

    theta = factor.theta
    if (theta[positive] >= 0).all():
        return theta
    # An active-set method, which meets an active bound exactly.  Stark and Parker, 1995
    solution = lsq_linear(factor.U, factor.y, (np.where(positive, 0.0, -np.inf), np.inf), method="bvls", tol=1e-14)
    return np.asarray(solution.x / factor.scale)


class ColumnAnalysis(NamedTuple):
    """Correlations of p estimates, and the singular value decomposition of the regressor's scaled columns."""

    correlation: Array  # (p, p) of the estimates
    singular_values: Array  # (p,) of the columns scaled to unit length, the largest first
    directions: Array  # (p, p) right singular vectors in rows, in the order of `singular_values`

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns."""
        return float(self.singular_values[0] / self.singular_values[-1])


def analyse_columns(factor: Triangle) -> ColumnAnalysis:
    """Analyse the columns of a triangular factor; they must be linearly independent."""
    inverse = np.linalg.inv(factor.U)
    covariance = inverse @ inverse.T
    std = np.sqrt(np.diag(covariance))
    _, singular_values, directions = np.linalg.svd(factor.U)
    return ColumnAnalysis(covariance / std / std[:, None], singular_values, directions)


def correlated_pairs(analysis: ColumnAnalysis, minimum: float) -> list[tuple[int, int, float]]:
    """Pairs of parameters, and their correlation if its magnitude is at least `minimum`; the strongest first."""
    p = len(analysis.singular_values)
    entries = [(i, j, float(analysis.correlation[i, j])) for i in range(p) for j in range(i + 1, p)]
    return sorted((pair for pair in entries if abs(pair[2]) >= minimum), key=lambda pair: -abs(pair[2]))


def uncertain_combinations(
    analysis: ColumnAnalysis, min_ratio: float, min_part: float
) -> list[tuple[tuple[int, ...], float]]:
    """Combinations at least `min_ratio` times less certain than the best one: their parameters and that ratio.

    A parameter belongs to a combination if its squared component in the singular vector is at least `min_part`.
    """
    ratios = analysis.singular_values[0] / analysis.singular_values
    return [
        (tuple(np.flatnonzero(direction**2 >= min_part).tolist()), float(ratio))
        for ratio, direction in zip(ratios[::-1], analysis.directions[::-1], strict=True)
        if ratio >= min_ratio
    ]


def dependent_parameters(U: Array, min_part: float) -> list[int]:
    """Parameters whose squared component in the least determined direction of U (p, p) is at least `min_part`."""
    return np.flatnonzero(np.linalg.svd(U)[2][-1] ** 2 >= min_part).tolist()


def std_of_sum(correlation: Array, std: Array, weights: Array) -> float:
    """Standard error of the weighted sum of parameters that have the standard errors `std` (p,)."""
    scaled = weights * std
    return float(np.sqrt(max(float(scaled @ correlation @ scaled), 0.0)))
