"""Least squares with parameters of which physics knows the sign."""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.estimation.least_squares import Triangle


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
