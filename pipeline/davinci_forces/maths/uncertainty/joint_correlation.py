"""How the errors of several joints go together: what other logs say of it, as far as they agree.

R = (1 - s) I + s mean(R_i),    s = max(0, 1 - var / mean_of_squares)

of the correlations of n logs, var being the variance of their mean that the spread between logs gives it.  Logs that
disagree leave no correlation, and a single one does, for nothing tells whether it would repeat.
"""

import numpy as np

from davinci_forces.maths.arrays import Array


def shared(rho: Array) -> Array:
    """The correlations (p,) that logs (n, p) share; of fewer than two logs, none."""
    if len(rho) < 2:
        return np.zeros(rho.shape[1])
    mean, var = rho.mean(0), rho.var(0, ddof=1) / len(rho)
    squares = float(np.sum(mean**2))
    share = max(0.0, 1.0 - float(var.sum()) / squares) if squares else 0.0
    return np.asarray(share * mean)


def matrix(rho_12: float, rho_13: float, rho_23: float) -> Array:
    """The correlations of three joints as a matrix (3, 3)."""
    return np.array([[1.0, rho_12, rho_13], [rho_12, 1.0, rho_23], [rho_13, rho_23, 1.0]])
