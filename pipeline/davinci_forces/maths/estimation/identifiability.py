"""Which parameters rows tell apart, and which they tell only together.

    cov(theta) ~ (Phi' Phi)^-1,    Phi D^-1 = Q U,    U = A diag(sizes) B'

D scales the columns to unit length.  A direction of B whose size is small is a combination of parameters that hardly
changes the effort; two parameters whose estimates are correlated move together.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Triangle


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
