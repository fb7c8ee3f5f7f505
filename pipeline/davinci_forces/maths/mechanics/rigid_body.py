"""The dynamics of an arm's links, from its chain and bodies.

    tau = M(q) ddq + C(q, dq) dq + G(q)                                                              (4.9), (4.27)

Shapes: q, dq, ddq, tau are (..., n) in rad or m, their rates, and N m or N.  Leading axes broadcast.  If the chain has
more than n coordinates, the others are at rest at 0.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics import recursions
from davinci_forces.maths.mechanics.bodies import Bodies, Drives
from davinci_forces.maths.mechanics.chain import Chain, Tree, fold_fixed_links, tree_of
from davinci_forces.maths.mechanics.kinematics import poses_of_bodies

ALL = (slice(None),)  # index of all samples, for numpy
RANDOM_POSES = 20  # poses in which the effort of each joint is tested for gravity
# [m, or N/kg] Products of lengths of metres have rounding errors of 1e-15; files state angles to eleven digits.
MIN_GRAVITY_ENTRY = 1e-6
COMPILE_FROM = 20_000  # samples; numpy computes fewer before the kernels are loaded, and they take long to compile


def mass_matrix(chain: Chain, bodies: Bodies, q: ArrayLike, drives: Drives | None = None) -> Array:
    """M (..., n, n), symmetric positive definite; if drives are given, with their rotors' inertia.  (4.28), (4.38)"""
    q = np.asarray(q, float)
    n, tree = q.shape[-1], moving_tree(chain, bodies, q.shape[-1])
    if _many(q):
        from davinci_forces.maths.mechanics.kernels import mass_matrices

        M = np.empty((*q.shape, n))
        mass_matrices(tree, _rows(q), M.reshape(-1, n, n))
    else:
        joints = _joints(q, q, q)
        N, L = joints.shape[2], len(tree.parent)
        entries, work = np.empty((n, n, N)), np.zeros((n * (L + 1) + 1, 6, N))
        recursions.mass_matrix(tree.lists(), joints, work, entries, ALL)
        lower = np.tril(np.moveaxis(entries, -1, 0))
        M = (lower + np.tril(lower, -1).swapaxes(1, 2)).reshape(*q.shape, n)
    return M if drives is None else np.asarray(M + np.diag(drives.inertia))


def gravity(chain: Chain, bodies: Bodies, q: ArrayLike) -> Array:
    """G (..., n): the effort that holds the arm still.  (4.38)"""
    return inverse_dynamics(chain, bodies, q, 0.0, 0.0)


def coriolis(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike) -> Array:
    """C dq (..., n): centrifugal and Coriolis efforts.  (4.38)"""
    return _newton_euler(chain, bodies, 0.0, q, dq, 0.0)


def coriolis_matrix(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike) -> Array:
    """C (..., n, n) of the Christoffel symbols, for which dM/dt - 2 C is skew-symmetric.  (5.6), (5.12)

    C dq is a quadratic form of dq; column j is its bilinear form of dq and the unit velocity of coordinate j.
    """
    q, dq = np.broadcast_arrays(np.asarray(q, float), np.asarray(dq, float))
    units = np.eye(q.shape[-1])
    columns = coriolis(chain, bodies, q[..., None, :], np.stack([dq[..., None, :] + units, dq[..., None, :] - units]))
    return np.asarray(np.swapaxes(columns[0] - columns[1], -1, -2) / 4)


def forward_dynamics(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike, tau: ArrayLike) -> Array:
    """The acceleration ddq (..., n) that efforts tau cause, without contact.  (4.41)"""
    bias = inverse_dynamics(chain, bodies, q, dq, 0.0)
    M = mass_matrix(chain, bodies, q)
    return np.asarray(np.linalg.solve(M, (np.asarray(tau, float) - bias)[..., None])[..., 0])


def energy(chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array]:
    """Kinetic and potential energy (...,) [J]; the potential energy is 0 at the origin of the base.  (4.12)-(4.15)"""
    q, dq = np.broadcast_arrays(np.asarray(q, float), np.asarray(dq, float))
    pi = bodies.parameters(q.shape[-1]).reshape(-1, 10)
    T = poses_of_bodies(chain, q)[..., 1:, :, :]
    moment = np.einsum("...lij,lj->...i", T[..., :3, :], np.column_stack([pi[:, 1:4], pi[:, 0]]))
    kinetic = np.einsum("...i,...ij,...j->...", dq, mass_matrix(chain, bodies, q), dq) / 2
    return np.asarray(kinetic), np.asarray(GRAVITY * moment @ np.array(chain.up))


def inverse_dynamics(
    chain: Chain, bodies: Bodies, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, drives: Drives | None = None
) -> Array:
    """The effort tau (..., n) of this motion without contact.  (4.27), (4.28), (7.27)"""
    tau = _newton_euler(chain, bodies, GRAVITY, q, dq, ddq)
    return tau if drives is None else tau + drives.inertia * np.asarray(ddq, float) + drives.friction(dq)


def regressor(
    chain: Chain, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, rows: Sequence[int] | None = None, L: int | None = None
) -> Array:
    """Y (..., n, 10 L) of tau = Y pi, with the inertial parameters pi of all links (`Bodies.parameters`).  (6.3)

    With `rows` and `L`, Y (..., m, 10 L) has the efforts of m coordinates, and the parameters of the first L links.
    """
    q, dq, ddq = np.broadcast_arrays(*(np.asarray(x, float) for x in (q, dq, ddq)))
    n, L = q.shape[-1], len(chain.parent) if L is None else L
    rows, N = list(range(n) if rows is None else rows), q.size // n
    tree = massless_tree(chain, n)
    moves = tree.moves & np.isin(np.arange(n), rows)
    work, Y = np.zeros(((n + 1) * (L + 1), 9, N)), np.zeros((n, L, 10, N))
    first_links = tree._replace(parent=tree.parent[:L], moves=moves).lists()
    recursions.regressor(first_links, GRAVITY, _joints(q, dq, ddq), work, Y, ALL)
    return np.moveaxis(Y[rows], -1, 0).reshape(*q.shape[:-1], len(rows), 10 * L)


def compiled_regressor(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """Y (..., n, 10 L) of `regressor`, by the compiled kernels: for callers that compute all of it repeatedly."""
    from davinci_forces.maths.mechanics.kernels import regressors

    n, L = q.shape[-1], len(chain.parent)
    Y = np.empty((*q.shape, 10 * L))
    regressors(massless_tree(chain, n), GRAVITY, _rows(q), _rows(dq), _rows(ddq), Y.reshape(-1, n, L, 10))
    return Y


@cache  # a search asks for thousands of regressors of one chain
def massless_tree(chain: Chain, n: int) -> Tree:
    """The tree of all links with the first n coordinates of the arm; a regressor does not depend on their masses."""
    return tree_of(chain.with_coordinates(n), np.zeros((len(chain.parent), 10)))


def loaded_by_gravity(chain: Chain) -> list[bool]:
    """Whether gravity loads each coordinate in any pose; a vertical axis of rotation is never loaded."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (RANDOM_POSES, chain.n))
    Y = regressor(chain, q, np.zeros_like(q), np.zeros_like(q))
    return [bool(x) for x in abs(Y).max(axis=(0, 2)) > MIN_GRAVITY_ENTRY]


def moving_tree(chain: Chain, bodies: Bodies, n: int) -> Tree:
    """The tree of the arm with its first n coordinates; links that do not move are merged into their parents."""
    return tree_of(*fold_fixed_links(chain.with_coordinates(n), bodies.parameters(n).reshape(-1, 10)))


def _newton_euler(chain: Chain, bodies: Bodies, g: float, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
    q, dq, ddq = np.broadcast_arrays(*(np.asarray(x, float) for x in (q, dq, ddq)))
    tree = moving_tree(chain, bodies, q.shape[-1])
    if _many(q):
        from davinci_forces.maths.mechanics import kernels

        tau = np.empty(q.shape)
        kernels.inverse_dynamics(tree, g, _rows(q), _rows(dq), _rows(ddq), _rows(tau))
        return tau
    joints = _joints(q, dq, ddq)
    efforts, work = np.empty((tree.n, joints.shape[2])), np.zeros((len(tree.parent) + 1, 15, joints.shape[2]))
    recursions.inverse_dynamics(tree.lists(), g, joints, work, efforts, ALL)
    return efforts.T.reshape(q.shape)


def _many(q: Array) -> bool:
    """Whether q (..., n) has so many samples that the kernels save more time than loading them takes."""
    return bool(q.size >= COMPILE_FROM * q.shape[-1])


def _rows(x: Array) -> Array:
    """Reshape x (..., n) to a contiguous array (N, n); a view if x is contiguous."""
    return np.ascontiguousarray(x, float).reshape(-1, x.shape[-1])


def _joints(q: Array, dq: Array, ddq: Array) -> Array:
    """cos q, sin q, q, dq, ddq of every coordinate (n + 1, 5, N); the last row is zeros, for links that never move."""
    joints = np.zeros((q.shape[-1] + 1, 5, q.size // q.shape[-1]))
    for i, x in enumerate((np.cos(q), np.sin(q), q, dq, ddq)):
        joints[:-1, i] = x.reshape(-1, q.shape[-1]).T
    return joints
