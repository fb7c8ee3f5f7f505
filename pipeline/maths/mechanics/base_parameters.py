"""Which combinations of an arm's inertial parameters its motion can tell.

    tau = Y(q, dq, ddq) pi,    Y P = Y_b [1 K],    beta = pi_b + K pi_d                                      (6.3)

P sorts the columns of Y into p base columns and those that depend on them.  Gautier, Numerical calculation of the base
inertial parameters of robots, 1991.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from pipeline.maths.arrays import Array
from pipeline.maths.mechanics.bodies import PARAMETERS

NEGLIGIBLE = 1e-9  # of the largest pivot: rounding makes 1e-15, and the smallest true one of the da Vinci is 1e-3


class BaseParameters(NamedTuple):
    """What the motion can tell of the inertial parameters: beta = K pi, p combinations of the 10 L."""

    columns: NDArray[np.int64]  # (p,) of Y, which span all the others: tau = Y[:, columns] beta
    combination: Array  # K (p, 10 L): how all parameters enter each
    condition: float  # of the base columns, each scaled to unit length

    def names(self, links: tuple[str, ...]) -> list[str]:
        """Each base parameter by the link and parameter that leads it, as `Ixx of 5`."""
        return [f"{PARAMETERS[c % 10]} of {links[c // 10]}" for c in self.columns]


def base_parameters(Y: Array) -> BaseParameters:
    """Reduce the regressor (..., 10 L) of a motion to independent columns, by QR with pivoting on scaled columns.

    The motion must be rich (random poses, velocities and accelerations will do): what it does not show is left out.
    """
    triangle = _triangle(Y.reshape(-1, Y.shape[-1]))
    scale = np.linalg.norm(triangle, axis=0)
    seen = np.flatnonzero(scale > NEGLIGIBLE * scale.max())
    _, R, order = qr(triangle[:, seen] / scale[seen], mode="economic", pivoting=True)
    p = int(np.sum(np.abs(np.diag(R)) > NEGLIGIBLE * abs(R[0, 0])))
    base, others = seen[order[:p]], seen[order[p:]]
    K = np.zeros((p, len(scale)))
    K[np.arange(p), base] = 1.0
    K[:, others] = solve_triangular(R[:p, :p], R[:p, p:]) * scale[others] / scale[base][:, None]
    by_link = np.argsort(base)
    return BaseParameters(base[by_link], K[by_link], float(np.linalg.cond(R[:p, :p])))


def _triangle(Y: Array) -> Array:
    """R of Y = Q R: it has the dependences of Y's columns, in as many rows as there are columns."""
    (R,) = qr(Y, mode="r")
    return np.asarray(R[: Y.shape[1]], float)
