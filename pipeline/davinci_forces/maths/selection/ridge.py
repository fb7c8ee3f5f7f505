"""Least squares that is told how far to trust the data: a ridge on columns scaled to the same size.

    theta = arg min sum_i w_i |tau_i - Phi_i theta|^2 + lambda theta' P theta

Base parameters beta = K pi are the least of what they can be: their penalty is that of the smallest pi, each scaled by
its column, so that it does not depend on which parameters lead the combinations:

    P = (K D^-1 K')^-1,    D = diag(K' G K)
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.selection.equations import Equations

UNSEEN = 1e-12  # of the largest column's square, below which a column is nothing but rounding
ROUNDING = 1e-12  # of the largest column, below which rounding is all that there is of one
DEPENDENT = 1e12  # condition of the equations of scaled columns, the square of the columns' own


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
