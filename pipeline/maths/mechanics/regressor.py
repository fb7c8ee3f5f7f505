"""The dynamics of an arm's links as linear in their inertial parameters, and which of these the motion can tell.

    tau = Y(q, dq, ddq) pi,    Y P = Y_b [1 K],    beta = pi_b + K pi_d                                      (6.3)

P sorts the columns of Y into p base columns and those that depend on them.  Gautier, Numerical calculation of the base
inertial parameters of robots, 1991.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import qr, solve_triangular

from pipeline.maths.arrays import Array
from pipeline.maths.constants import GRAVITY
from pipeline.maths.mechanics.bodies import PARAMETERS, from_parameters
from pipeline.maths.mechanics.kinematics import Chain, frames, jacobian_rates, spatial_jacobians
from pipeline.maths.mechanics.samples import many, rows
from pipeline.maths.mechanics.spatial import contract, skew

NEGLIGIBLE = 1e-9  # of the largest pivot: rounding makes 1e-15, and the smallest true one of the da Vinci is 1e-3


def regressor(chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
    """Y (..., n, 10 L) with tau = Y pi, pi the inertial parameters of all links (`Bodies.parameters`).  (6.3)"""
    q, dq, ddq = np.broadcast_arrays(*(np.asarray(x, float) for x in (q, dq, ddq)))
    if many(q):
        return _compiled_regressor(chain, q, dq, ddq)
    chain = chain.reduced(q.shape[-1])
    T = frames(chain, q)
    J, J_dot = spatial_jacobians(chain, T)[..., 1:, :, :], jacobian_rates(chain, T, dq)
    R, origin = T[..., 1:, :3, :3], T[..., 1:, :3, 3]
    J_w = np.swapaxes(R, -1, -2) @ J[..., :3, :]
    J_v = np.swapaxes(R, -1, -2) @ (J[..., 3:, :] - skew(origin) @ J[..., :3, :])
    v, felt = _at_links(J, dq, R, origin), _at_links(J, ddq, R, origin) + _at_links(J_dot, dq, R, origin)
    felt[..., 3:] += GRAVITY * R[..., 2, :]
    force, moment = _wrench_columns(v, felt)
    Y = contract("...lik,...lip->...klp", J_v, force) + contract("...lik,...lip->...klp", J_w, moment)
    return Y.reshape(*q.shape, 10 * len(chain.parent))


def _at_links(J: Array, rates: Array, R: Array, origin: Array) -> Array:
    """J times rates, in each link's own axes about its own origin (..., L, 6)."""
    x = contract("...lck,...k->...lc", J, rates)
    w, v = x[..., :3], x[..., 3:] + np.cross(x[..., :3], origin)
    return np.concatenate([contract("...lji,...lj->...li", R, w), contract("...lji,...lj->...li", R, v)], axis=-1)


def _wrench_columns(v: Array, felt: Array) -> tuple[Array, Array]:
    """Force and moment on a link by its ten parameters (..., L, 3, 10).

    f = m a + (dw x + w x w x) h,  n = h x a + I dw + w x I w,  with a the acceleration of the frame's origin.
    """
    w, dw = v[..., :3], felt[..., :3]
    a = felt[..., 3:] + np.cross(w, v[..., 3:])
    force, moment = np.zeros((*w.shape, 10)), np.zeros((*w.shape, 10))
    W = skew(w)
    force[..., 0] = a
    force[..., 1:4] = skew(dw) + W @ W
    moment[..., 1:4] = -skew(a)
    moment[..., 4:] = _inertia_columns(dw) + W @ _inertia_columns(w)
    return force, moment


def _inertia_columns(w: Array) -> Array:
    """L(w) (..., 3, 6) with I w = L(w) [Ixx, Ixy, Ixz, Iyy, Iyz, Izz]."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    L = np.zeros((*w.shape, 6))
    L[..., 0, 0], L[..., 0, 1], L[..., 0, 2] = x, y, z
    L[..., 1, 1], L[..., 1, 3], L[..., 1, 4] = x, y, z
    L[..., 2, 2], L[..., 2, 4], L[..., 2, 5] = x, y, z
    return L


def _compiled_regressor(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    from pipeline.maths.mechanics import lanes, regressor_lanes

    L, n = len(chain.parent), q.shape[-1]
    Y = np.empty((*q.shape, 10 * L))
    weightless = from_parameters(np.zeros(10 * L), np.zeros(L, np.int64))
    arm = lanes.pack(chain, weightless, n, fold=False)
    regressor_lanes.regressors(arm, GRAVITY, *map(rows, (q, dq, ddq)), Y.reshape(-1, n, 10 * L))
    return Y


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
