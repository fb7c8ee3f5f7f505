"""Least squares by orthogonal triangles, in one pass over the rows.

    W^(1/2) [Phi tau] = Q [[U, y], [0, e]],    theta = U^-1 y,    |W^(1/2) (tau - Phi theta)|^2 = |U theta - y|^2 + e^2

The triangle has all the information of the data for least squares, with or without bounds.  It also shows which
parameters the data determine singly, and which only in combination:

    cov(theta) ~ (Phi' Phi)^-1,    Phi D^-1 = Q U,    U = A diag(sizes) B'

D scales the columns to unit length.  A direction of B whose size is small is a combination of parameters that hardly
changes the effort; two parameters whose estimates are correlated move together.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans


class Triangle(NamedTuple):
    """Triangular factor of K weighted rows for p parameters, with the columns scaled to unit length."""

    U: Array  # (p, p) upper triangular
    y: Array  # (p,)
    squares: float  # e^2, the least residual squares
    scale: Array  # (p,) lengths of the columns

    @property
    def theta(self) -> Array:
        """Least-squares parameters (p,).  (6.46)"""
        return np.asarray(np.linalg.solve(self.U, self.y) / self.scale)

    def excess(self, theta: Array) -> Array:
        """Excess (...) of the weighted squares of parameters (..., p) over the least."""
        return np.asarray((((theta * self.scale) @ self.U.T - self.y) ** 2).sum(axis=-1))


def triangle(Phi: Array, tau: Array, weight: Array) -> Triangle:
    """Factor Phi (K, p) and tau (K,), with a weight (K,) of each row; a column of zeros stays one."""
    from davinci_forces.maths.estimation import kernels

    p = Phi.shape[1]
    R = np.empty((p + 1, p + 1))
    kernels.triangularise(Phi, tau, weight, R)
    scale = np.linalg.norm(R[:, :p], axis=0)
    return Triangle(R[:p, :p] / np.where(scale > 0, scale, 1.0), R[:p, p], float(R[p, p] ** 2), scale)


def solve_bounded(R: Triangle, positive: Booleans) -> Array:
    """Least-squares parameters (p,) that are not negative where `positive` (p,).

    The active-set method (Stark and Parker, 1995) meets an active bound exactly.
    """
    from scipy.optimize import lsq_linear

    theta = R.theta
    if (theta[positive] >= 0).all():
        return theta
    solution = lsq_linear(R.U, R.y, (np.where(positive, 0.0, -np.inf), np.inf), method="bvls", tol=1e-14)
    return np.asarray(solution.x / R.scale)


class ColumnAnalysis(NamedTuple):
    """Correlations of p estimates, and the singular values and directions of their columns."""

    correlation: Array  # (p, p) of their estimates
    sizes: Array  # (p,) singular values of the columns scaled to unit length, the largest first
    directions: Array  # (p, p) the unit vector of scaled parameters that belongs to each, in rows

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns."""
        return float(self.sizes[0] / self.sizes[-1])


def analyse_columns(R: Triangle) -> ColumnAnalysis:
    """Analyse the columns of a triangle, which must be independent."""
    inverse = np.linalg.inv(R.U)
    covariance = inverse @ inverse.T
    std = np.sqrt(np.diag(covariance))
    _, sizes, directions = np.linalg.svd(R.U)
    return ColumnAnalysis(covariance / std / std[:, None], sizes, directions)


def pairs(analysis: ColumnAnalysis, least: float) -> list[tuple[int, int, float]]:
    """Pairs of parameters whose estimates correlate by at least `least`, the largest first, with the correlation."""
    p = len(analysis.sizes)
    entries = [(i, j, float(analysis.correlation[i, j])) for i in range(p) for j in range(i + 1, p)]
    return sorted((pair for pair in entries if abs(pair[2]) >= least), key=lambda pair: -abs(pair[2]))


def combinations(analysis: ColumnAnalysis, weak: float, part: float) -> list[tuple[tuple[int, ...], float]]:
    """Directions determined at least `weak` times worse than the best one: their parameters and that ratio.

    A parameter belongs to a direction if its share of the unit vector's square is at least `part`.
    """
    ratios = analysis.sizes[0] / analysis.sizes
    return [
        (tuple(np.flatnonzero(direction**2 >= part).tolist()), float(ratio))
        for ratio, direction in zip(ratios[::-1], analysis.directions[::-1], strict=True)
        if ratio >= weak
    ]


def dependent_parameters(U: Array, part: float) -> list[int]:
    """Parameters with at least the share `part` of the square of the direction that columns U (p, p) show least."""
    return np.flatnonzero(np.linalg.svd(U)[2][-1] ** 2 >= part).tolist()


def deviation(correlation: Array, std: Array, weights: Array) -> float:
    """Standard error of a weighted sum of parameters with standard errors (p,)."""
    scaled = weights * std
    return float(np.sqrt(max(float(scaled @ correlation @ scaled), 0.0)))
