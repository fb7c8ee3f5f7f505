"""Least squares by orthogonal triangles, in one pass over the rows.

    W^(1/2) [Phi tau] = Q [[U, y], [0, e]],    theta = U^-1 y,    |W^(1/2) (tau - Phi theta)|^2 = |U theta - y|^2 + e^2

The triangle holds all that least squares, with bounds or without, ask of the data.
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
