"""Normal equations by cells of the data, so that any part of them can be left out of a fit without going back to it.

G = sum Phi' Phi,    r = sum Phi' tau,    s = sum tau^2,    |tau - Phi theta|^2 = s - 2 r' theta + theta' G theta
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers


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
