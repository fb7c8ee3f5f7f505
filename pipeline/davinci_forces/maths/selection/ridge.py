"""Least squares that is told how far to trust the data: a ridge on columns scaled to the same size.

    theta = arg min sum_i w_i |tau_i - Phi_i theta|^2 + lambda theta' P theta

Base parameters beta = K pi are the least of what they can be: their penalty is that of the smallest pi, each scaled by
its column, so that it does not depend on which parameters lead the combinations:

    P = (K D^-1 K')^-1,    D = diag(K' G K)

Normal equations by cells of the data, so that any part of them can be left out of a fit without going back to it.

G = sum Phi' Phi,    r = sum Phi' tau,    s = sum tau^2,    |tau - Phi theta|^2 = s - 2 r' theta + theta' G theta
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers

UNSEEN = 1e-12  # of the largest column's square, below which a column is nothing but rounding
ROUNDING = 1e-12  # of the largest column, below which rounding is all that there is of one
DEPENDENT = 1e12  # condition of the equations of scaled columns, the square of the columns' own


class Equations(NamedTuple):
    """What least squares needs of m efforts in C cells."""

    gram: Array  # (C, m, p, p)
    right: Array  # (C, m, p)
    squares: Array  # (C, m)

    def without(self, cells: Booleans) -> "Equations":
        """Those of all other cells (C,), as one."""
        return self.of(~cells)

    def of(self, cells: Booleans) -> "Equations":
        """Those of some cells (C,), as one."""
        return Equations(*(part[cells].sum(axis=0, keepdims=True) for part in self))

    def errors(self, theta: Array) -> Array:
        """|tau - Phi theta|^2 (C, m) of parameters (p,)."""
        product = np.einsum("cmpq,p,q->cm", self.gram, theta, theta)
        return np.asarray(np.maximum(self.squares - 2.0 * self.right @ theta + product, 0.0))

    def columns(self, which: Sequence[int] | Integers) -> "Equations":
        """Those of some of the parameters."""
        index = np.asarray(which, np.int64)
        return Equations(self.gram[:, :, index][..., index], self.right[..., index], self.squares)


def gathered(Phi: Array, tau: Array, cell: Integers, cells: int) -> Equations:
    """The equations of Phi (N, m, p) and tau (N, m), the rows of which are in cells (N,); rows in cell -1 are left out.

    An effort counts nothing where it is NaN.
    """
    m, p = Phi.shape[1:]
    made = Equations(np.zeros((cells, m, p, p)), np.zeros((cells, m, p)), np.zeros((cells, m)))
    for c in np.unique(cell[cell >= 0]).tolist():
        rows = cell == c
        for i in range(m):
            told = rows & ~np.isnan(tau[:, i])
            if told.any():
                F, z = Phi[told, i], tau[told, i]
                made.gram[c, i], made.right[c, i], made.squares[c, i] = F.T @ F, F.T @ z, z @ z
    return made


def side_by_side(parts: Sequence[Equations], places: Sequence[int], count: int) -> Equations:
    """Equations of as many cells each as `count` such parts of as many cells, each in its place; other cells hold 0."""
    made = Equations(*(np.zeros((count, *column.shape)) for column in parts[0]))
    for place, part in zip(places, parts, strict=True):
        for whole, column in zip(made, part, strict=True):
            whole[place] = column
    return Equations(*(column.reshape(-1, *column.shape[2:]) for column in made))


class Ridge(NamedTuple):
    """How parameters are found from normal equations."""

    strength: float  # lambda [-]
    weights: Array  # w (m,) of the efforts
    combination: Array  # K (b, 10 L + ...) of the first b parameters; the others stand for themselves


def solve(equations: Equations, ridge: Ridge) -> Array:
    """Parameters (p,) from equations of one cell.

    Raises
    ------
    LinAlgError
        If the columns are linearly dependent and no ridge tells them apart.
    """
    scaled, size = scaled_equations(equations, ridge)
    return np.asarray(np.linalg.solve(scaled, ridge.weights @ equations.right[0] / size) / size)


def scaled_equations(equations: Equations, ridge: Ridge) -> tuple[Array, Array]:
    """G + lambda P (p, p) of columns scaled to unit length, and their lengths (p,); raises as `solve` does."""
    G = np.einsum("m,mpq->pq", ridge.weights, equations.gram[0])
    size = np.sqrt(np.diag(G))
    # Scaled up, and told apart by a ridge, rounding would look like any other column.  Of an arm's base parameters some
    # are never seen where a joint is held, and the others are none the worse for it.
    least = 0.0 if len(ridge.combination) else ROUNDING * size.max()
    if not (size > least).all():
        raise np.linalg.LinAlgError("a column is zero throughout")
    scaled = (G + ridge.strength * penalty(G, ridge.combination)) / size / size[:, None]
    if ridge.strength == 0.0 and np.linalg.cond(scaled) > DEPENDENT:
        raise np.linalg.LinAlgError("the columns are linearly dependent")
    return scaled, size


def covariance(equations: Equations, ridge: Ridge, variances: Array) -> Array:
    """The covariance (p, p) of the parameters where rows of each effort err by independent noise of a variance (m,)."""
    scaled, size = scaled_equations(equations, ridge)
    inverse = np.linalg.inv(scaled) / size / size[:, None]
    return np.asarray(inverse @ np.einsum("m,mpq->pq", ridge.weights**2 * variances, equations.gram[0]) @ inverse)


def penalty(G: Array, combination: Array) -> Array:
    """P (p, p): of each parameter its column's square, of base parameters that of the smallest they can be made of."""
    P, b = np.diag(np.diag(G)), len(combination)
    if b:
        D = ((G[:b, :b] @ combination) * combination).sum(axis=0)
        seen = UNSEEN * D.max() < D
        K = combination[:, seen]
        P[:b, :b] = np.linalg.inv((K / D[seen]) @ K.T)
    return P
