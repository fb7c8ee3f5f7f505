"""Least squares by orthogonal triangles, in one pass over the rows.

    W^(1/2) [Phi tau] = Q [[U, y], [0, e]],    theta = U^-1 y,    |W^(1/2) (tau - Phi theta)|^2 = |U theta - y|^2 + e^2

The triangle holds all that least squares, with bounds or without, ask of the data.  It says, too, which parameters they
tell apart, and which they tell only together:

    cov(theta) ~ (Phi' Phi)^-1,    Phi D^-1 = Q U,    U = A diag(sizes) B'

D scales the columns to unit length.  A direction of B whose size is small is a combination of parameters that hardly
changes the effort; two parameters whose estimates are correlated move together.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans


class Triangle(NamedTuple):
    """What K weighted rows say of p parameters, with the columns scaled to unit length."""

    U: Array  # (p, p) upper triangular
    y: Array  # (p,)
    squares: float  # e^2, what no parameters explain
    scale: Array  # (p,) lengths of the columns

    @property
    def theta(self) -> Array:
        """The parameters (p,) of least squares.  (6.46)"""
        return np.asarray(np.linalg.solve(self.U, self.y) / self.scale)

    def excess(self, theta: Array) -> Array:
        """By how much the weighted squares (...) of parameters (..., p) exceed the least."""
        return np.asarray((((theta * self.scale) @ self.U.T - self.y) ** 2).sum(axis=-1))


def triangle(Phi: Array, tau: Array, weight: Array) -> Triangle:
    """Factor Phi (K, p) and tau (K,), each row counting by its weight (K,); a column of zeros stays one."""
    from davinci_forces.maths.estimation import kernels

    p = Phi.shape[1]
    R = np.empty((p + 1, p + 1))
    kernels.triangularise(Phi, tau, weight, R)
    scale = np.linalg.norm(R[:, :p], axis=0)
    return Triangle(R[:p, :p] / np.where(scale > 0, scale, 1.0), R[:p, p], float(R[p, p] ** 2), scale)


def bounded(R: Triangle, positive: Booleans) -> Array:
    """The parameters (p,) of least squares among those that are not negative where `positive` (p,) says so.

    They are found by active sets (Stark and Parker, 1995), so a bound that holds is met exactly.
    """
    from scipy.optimize import lsq_linear

    theta = R.theta
    if (theta[positive] >= 0).all():
        return theta
    found = lsq_linear(R.U, R.y, (np.where(positive, 0.0, -np.inf), np.inf), method="bvls", tol=1e-14)
    return np.asarray(found.x / R.scale)


class Told(NamedTuple):
    """What rows say of p parameters."""

    correlation: Array  # (p, p) of their estimates
    sizes: Array  # (p,) singular values of the columns scaled to unit length, the largest first
    directions: Array  # (p, p) the unit vector of scaled parameters that belongs to each, in rows

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns."""
        return float(self.sizes[0] / self.sizes[-1])


def told(R: Triangle) -> Told:
    """What the rows behind a triangle say of their parameters, which they have to tell apart."""
    inverse = np.linalg.inv(R.U)
    covariance = inverse @ inverse.T
    std = np.sqrt(np.diag(covariance))
    _, sizes, directions = np.linalg.svd(R.U)
    return Told(covariance / std / std[:, None], sizes, directions)


def pairs(told: Told, least: float) -> list[tuple[int, int, float]]:
    """Parameters whose estimates are correlated by at least so much, the most first, with their correlation."""
    p = len(told.sizes)
    every = [(i, j, float(told.correlation[i, j])) for i in range(p) for j in range(i + 1, p)]
    return sorted((pair for pair in every if abs(pair[2]) >= least), key=lambda pair: -abs(pair[2]))


def combinations(told: Told, weak: float, part: float) -> list[tuple[tuple[int, ...], float]]:
    """The directions that are told so many times less well than the best, and which parameters take part in each.

    A parameter takes part whose share of the unit vector's square is at least `part`.
    """
    ratios = told.sizes[0] / told.sizes
    return [
        (tuple(np.flatnonzero(direction**2 >= part).tolist()), float(ratio))
        for ratio, direction in zip(ratios[::-1], told.directions[::-1], strict=True)
        if ratio >= weak
    ]


def not_told_apart(U: Array, part: float) -> list[int]:
    """The parameters that take part, by this share of its square, in what columns U (p, p) tell least."""
    return np.flatnonzero(np.linalg.svd(U)[2][-1] ** 2 >= part).tolist()


def deviation(correlation: Array, std: Array, weights: Array) -> float:
    """The standard error of a weighted sum of parameters of standard errors (p,)."""
    scaled = weights * std
    return float(np.sqrt(max(float(scaled @ correlation @ scaled), 0.0)))
