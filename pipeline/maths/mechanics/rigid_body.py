"""The dynamics of an arm's links, from its chain and bodies, by projecting every body on the coordinates.

    tau = M(q) ddq + C(q, dq) dq + G(q),    M = sum J' I J,    C = sum J' (I dJ/dt + B J)        (4.9), (4.27)

J is a body's spatial Jacobian and I its spatial inertia, both in base axes about the base's origin.  This needs no
recursion and no derivatives by hand, so the branches and the shared q2 of the parallelogram cost nothing extra.

Shapes: q, dq, ddq, tau are (..., n) in rad or m, their rates, and N m or N.  Any leading axes; they broadcast.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pipeline.maths.arrays import Array
from pipeline.maths.constants import GRAVITY
from pipeline.maths.mechanics.bodies import Bodies
from pipeline.maths.mechanics.drives import Drives
from pipeline.maths.mechanics.kinematics import Chain, frames, jacobian_rates, spatial_jacobians
from pipeline.maths.mechanics.regressor import base_parameters, regressor
from pipeline.maths.mechanics.samples import many, rows
from pipeline.maths.mechanics.spatial import contract, dual, momentum_cross, motion_cross, spatial_inertias

__all__ = [
    "Energy", "base_parameters", "coriolis", "coriolis_matrix", "energy", "forward_dynamics", "gravity",
    "inverse_dynamics", "mass_matrix", "regressor",
]  # fmt: skip

UP = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # standing still feels like accelerating this way with g


class Energy(NamedTuple):
    """Energy of the links [J] (...,); the potential energy is 0 at the height of the base frame."""

    kinetic: Array
    potential: Array


class _State(NamedTuple):
    """The links of an arm in one pose: spatial Jacobians (..., L, 6, n) and inertias (..., L, 6, 6)."""

    T: Array
    J: Array
    inertia: Array


def _state(chain: Chain, bodies: Bodies, q: ArrayLike) -> _State:
    q = np.asarray(q, float)
    chain = chain.reduced(q.shape[-1])
    T = frames(chain, q)
    return _State(T, spatial_jacobians(chain, T)[..., 1:, :, :], spatial_inertias(bodies.counted(chain.n), T))


def mass_matrix(chain: Chain, bodies: Bodies, q: ArrayLike, drives: Drives | None = None) -> Array:
    """M (..., n, n), symmetric positive definite; with the rotors' inertia where drives are given.  (4.28), (4.38)"""
    q = np.asarray(q, float)
    if many(q):
        M = _compiled_mass(chain, bodies, q)
    else:
        _, J, inertia = _state(chain, bodies, q)
        M = contract("...lck,...lcm->...km", J, inertia @ J)
        M = (M + np.swapaxes(M, -1, -2)) / 2.0  # symmetric to the last bit, which rounding is not
    return M if drives is None else np.asarray(M + np.diag(drives.inertia))


def gravity(chain: Chain, bodies: Bodies, q: ArrayLike) -> Array:
    """G (..., n): the effort that holds the arm still.  (4.38)"""
    q = np.asarray(q, float)
    return _newton_euler(chain, bodies, q, np.zeros_like(q), np.zeros_like(q), GRAVITY)


def coriolis(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike) -> Array:
    """V = C dq (..., n): centrifugal and Coriolis efforts.  (4.38)"""
    q, dq = np.broadcast_arrays(np.asarray(q, float), np.asarray(dq, float))
    return _newton_euler(chain, bodies, q, dq, np.zeros_like(q), 0.0)


def coriolis_matrix(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike) -> Array:
    """C (..., n, n) with V = C dq, made of Christoffel's symbols, so that dM/dt - 2 C is skew.  (4.38)

    B = (v x* I - I v x + (I v) x~*) / 2 of each body: Echeandia and Wensing, Numerical methods to compute the Coriolis
    matrix and Christoffel symbols for rigid-body systems, 2021.
    """
    q, dq = np.broadcast_arrays(np.asarray(q, float), np.asarray(dq, float))
    T, J, inertia = _state(chain, bodies, q)
    J_dot = jacobian_rates(chain.reduced(q.shape[-1]), T, dq)
    v = contract("...lck,...k->...lc", J, dq)
    cross = motion_cross(v)
    momentum = contract("...lcd,...ld->...lc", inertia, v)
    B = (dual(cross) @ inertia - inertia @ cross + momentum_cross(momentum)) / 2.0
    return contract("...lck,...lcm->...km", J, inertia @ J_dot + B @ J)


def inverse_dynamics(
    chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, drives: Drives | None = None
) -> Array:
    """The effort tau (..., n) of this motion with nothing touching the arm.  (4.27), (4.28), (7.27)"""
    q, dq, ddq = np.broadcast_arrays(*(np.asarray(x, float) for x in (q, dq, ddq)))
    tau = _newton_euler(chain, bodies, q, dq, ddq, GRAVITY)
    return tau if drives is None else np.asarray(tau + drives.inertia * ddq + drives.friction(dq))


def _newton_euler(chain: Chain, bodies: Bodies, q: Array, dq: Array, ddq: Array, g: float) -> Array:
    """The wrench of every body, I a + v x* I v, projected on the coordinates."""
    if many(q):
        return _compiled_newton_euler(chain, bodies, q, dq, ddq, g)
    T, J, inertia = _state(chain, bodies, q)
    v = contract("...lck,...k->...lc", J, dq)
    J_dot = jacobian_rates(chain.reduced(q.shape[-1]), T, dq)
    felt = contract("...lck,...k->...lc", J, ddq) + contract("...lck,...k->...lc", J_dot, dq) + g * UP
    momentum = contract("...lcd,...ld->...lc", inertia, v)
    wrench = contract("...lcd,...ld->...lc", inertia, felt)
    wrench += contract("...lcd,...ld->...lc", dual(motion_cross(v)), momentum)
    return contract("...lck,...lc->...k", J, wrench)


def forward_dynamics(
    chain: Chain,
    bodies: Bodies,
    q: ArrayLike,
    dq: ArrayLike,
    tau: ArrayLike,
    tau_ext: ArrayLike = 0.0,
    drives: Drives | None = None,
) -> Array:
    """The acceleration ddq (..., n) under this effort, and what the arm exerts on its surroundings.  (4.41)"""
    tau, tau_ext = np.asarray(tau, float), np.asarray(tau_ext, float)
    bias = inverse_dynamics(chain, bodies, q, dq, np.zeros_like(tau), drives)
    M = mass_matrix(chain, bodies, q, drives)
    return np.asarray(np.linalg.solve(M, (tau - tau_ext - bias)[..., None])[..., 0])


def energy(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike, drives: Drives | None = None) -> Energy:
    """Kinetic and potential energy [J]; the kinetic one with the rotors' where drives are given.  (4.35), (4.36)"""
    q, dq = np.asarray(q, float), np.asarray(dq, float)
    kinetic = contract("...k,...km,...m->...", dq, mass_matrix(chain, bodies, q, drives), dq) / 2.0
    there, T = bodies.counted(q.shape[-1]), frames(chain, q)[..., 1:, :, :]
    heights = contract("...li,li->...l", T[..., 2, :3], there.centres) + T[..., 2, 3]
    return Energy(kinetic, GRAVITY * heights @ there.masses)


def _compiled_newton_euler(chain: Chain, bodies: Bodies, q: Array, dq: Array, ddq: Array, g: float) -> Array:
    from pipeline.maths.mechanics import lanes

    tau = np.empty(q.shape)
    arm = lanes.pack(chain, bodies, q.shape[-1])
    lanes.inverse_dynamics(arm, g, *map(rows, (q, dq, ddq)), rows(tau))
    return tau


def _compiled_mass(chain: Chain, bodies: Bodies, q: Array) -> Array:
    from pipeline.maths.mechanics import lanes

    n = q.shape[-1]
    M = np.empty((*q.shape, n))
    lanes.mass_matrices(lanes.pack(chain, bodies, n), rows(q), M.reshape(-1, n, n))
    return M
