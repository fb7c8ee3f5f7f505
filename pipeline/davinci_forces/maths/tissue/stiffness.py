"""The stiffness of one push: the slope of a straight line through force against depth, and what a push takes up."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, evenly
from davinci_forces.maths.estimation.correlation import correlated

FEWEST = 5  # samples that a line is drawn through
SHORTEST, LONGEST, LENGTHS = 0.05, 50.0, 25  # correlation lengths of a model's error over the range of depth
MOST = 200  # samples that the error of a model is followed through


class StraightLine(NamedTuple):
    """f = c + k d, by least squares."""

    k: float  # [N/m]
    k_std: float  # [N/m] by what the line leaves, correlated as it is
    c: float  # [N]
    r2: float


def straight(depth: Array, force: Array) -> StraightLine | None:
    """The ordinary line through forces (N,) [N] at depths (N,) [m], in order of time; None where there is none.  (8.1)

    Its intercept is what the force is at no depth: the weight that a sensor carries, what friction is taken wrongly.
    """
    if len(depth) < FEWEST or not np.ptp(depth) > 0:
        return None
    Q, R = np.linalg.qr(np.column_stack([np.ones_like(depth), depth - depth.mean()]))
    y = Q.T @ force
    residual = force - Q @ y
    c, k = np.linalg.solve(R, y)
    away = float(np.sum((force - force.mean()) ** 2))
    if not away > 0:
        return StraightLine(0.0, 0.0, float(c), 0.0)
    variance = correlated(Q, residual, (0,), np.linalg.inv(R), len(depth) - 2).variance
    return StraightLine(
        float(k), float(np.sqrt(variance[1])), float(c - k * depth.mean()), 1.0 - float(residual @ residual) / away
    )


def slope(depth: Array, force: Array) -> float:
    """The slope [N/m] of the ordinary line alone; NaN where there is none."""
    if len(depth) < FEWEST or not np.ptp(depth) > 0:
        return float("nan")
    away = depth - depth.mean()
    return float(away @ force / (away @ away))


def slope_error(depth: Array, std: float) -> float:
    """Standard deviation [N/m] of a line's slope by an error of the force that varies with depth (N,), of `std` [N].

    A constant error is the intercept's, and one that changes from sample to sample averages out; one in between does
    most.  How fast a model's error changes with depth is not known, so the worst is taken, over correlations that fall
    off exponentially, with a the weights of a slope:

        k_std = std max over l of sqrt(a' C a),    C = exp(-|d_i - d_j| / l),    a = (d - mean(d)) / |d - mean(d)|^2
    """
    few = np.sort(depth)[evenly(len(depth), MOST)]
    away = few - few.mean()
    a = away / float(away @ away)
    apart = np.abs(few[:, None] - few)
    lengths = np.ptp(few) * np.geomspace(SHORTEST, LONGEST, LENGTHS)
    return std * float(np.sqrt(max(a @ np.exp(-apart / length) @ a for length in lengths)))


def work(depth: Array, force: Array) -> float:
    """The work [J] that a force (N,) does along depths (N,), in order of time: the integral of f over d."""
    return float(np.sum(np.diff(depth) * (force[1:] + force[:-1]) / 2))


def median_std(k: Array, random: Array, common: float) -> float:
    """Standard error of the median of stiffnesses (n,), each with its own error (n,) and all with a `common` one.

    What they differ by beyond their errors is the tissue's.  The variance of a median is pi/2 that of a mean.
    """
    n = len(k)
    between = max(float(np.var(k, ddof=1)) - float(np.mean(random**2)), 0.0) if n > 1 else 0.0
    own = (float(np.mean(random**2)) + between) / n * (np.pi / 2 if n > 2 else 1.0)
    return float(np.hypot(np.sqrt(own), common))
