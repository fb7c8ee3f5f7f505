"""Which combinations of an arm's inertial parameters its motion can tell.

    tau = Y(q, dq, ddq) pi,    Y P = Y_b [1 K],    beta = pi_b + K pi_d                                      (6.3)

P sorts the columns of Y into p base columns and those that depend on them.  Gautier, Numerical calculation of the base
inertial parameters of robots, 1991.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import PARAMETERS

# Of a column's own size, what has to be left of it when the columns taken before are subtracted: rounding leaves 1e-15
# times the condition number of those, and the least that is left of a true one of the arms here is 1e-3.
NEGLIGIBLE = 1e-9


class BaseParameters(NamedTuple):
    """What the motion can tell of the inertial parameters: beta = K pi, p combinations of the 10 L."""

    columns: NDArray[np.int64]  # (p,) of Y, which span all the others: tau = Y[:, columns] beta
    combination: Array  # K (p, 10 L): how all parameters enter each
    condition: float  # of the base columns, each scaled to unit length

    def names(self, links: tuple[str, ...]) -> list[str]:
        """Each base parameter by the link and parameter that leads it, as `Ixx of 5`."""
        return [f"{PARAMETERS[c % 10]} of {links[c // 10]}" for c in self.columns]


def base_parameters(Y: Array) -> BaseParameters:
    """Reduce the regressor (..., 10 L) of a motion to independent columns.

    They are taken in the order of Y, from the base outwards, each that does not depend on those before it: the same
    ones whatever the motion, as in the grouping by hand (Khalil and Kleinfinger 1987).  The motion must be rich (random
    poses, velocities and accelerations will do): what it does not show is left out.
    """
    from scipy.linalg import qr, solve_triangular  # which every command would load

    (R,) = qr(Y.reshape(-1, Y.shape[-1]), mode="r")  # it has the dependences of Y's columns, in as many rows
    scale = np.linalg.norm(R, axis=0)
    seen = np.flatnonzero(scale > NEGLIGIBLE * scale.max())
    unit = R[:, seen] / scale[seen]
    Q = np.empty((len(unit), 0))
    taken = list[int]()
    for column, x in enumerate(unit.T):
        left = x - Q @ (Q.T @ x)
        left -= Q @ (Q.T @ left)  # once more, for what the first has left by rounding
        if (size := np.linalg.norm(left)) > NEGLIGIBLE:
            Q = np.column_stack([Q, left / size])
            taken.append(column)
    triangle = np.triu(Q.T @ unit[:, taken])
    K = np.zeros((len(taken), len(scale)))
    K[:, seen] = solve_triangular(triangle, Q.T @ unit) * scale[seen] / scale[seen[taken]][:, None]
    K[:, seen[taken]] = np.eye(len(taken))
    return BaseParameters(seen[taken], K, float(np.linalg.cond(triangle)))
