"""Poses and Jacobians of the frames of an arm.

Shapes: `q` is (..., n) in rad or m, with any leading axes.  If the chain has more than n coordinates, the others are 0.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.chain import FIXED, Chain

POSES_AT_ONCE = 1 << 14


def frames(chain: Chain, q: ArrayLike) -> Array:
    """The pose of every named frame in the base frame, homogeneous matrices (..., F, 4, 4) [m].  (3.6), (4.30)"""
    return np.asarray(poses_of_bodies(chain, np.asarray(q, float))[..., chain.body, :, :] @ chain.offset)


def poses_of_bodies(chain: Chain, q: Array) -> Array:
    """The pose of every body in the base frame (..., L + 1, 4, 4), the base first."""
    chain, samples = chain.with_coordinates(q.shape[-1]), q.reshape(-1, q.shape[-1]).T
    c, s = np.cos(samples), np.sin(samples)
    T = np.empty((len(chain.parent) + 1, 4, 3, samples.shape[1]))  # columns; samples last, for vector instructions
    T[0] = np.eye(4, 3)[..., None]
    for i, (parent, k) in enumerate(zip(chain.parent, chain.coordinate, strict=True)):
        x, y, z, origin = T[i + 1]
        T[i + 1] = np.einsum("ba,bcs->acs", chain.placement[i], T[parent])
        if k != FIXED and chain.slides[i]:
            origin += samples[k] * z
        elif k != FIXED:
            T[i + 1, :2] = c[k] * x + s[k] * y, c[k] * y - s[k] * x
    poses = np.zeros((samples.shape[1], len(T), 4, 4))
    poses[:, :, :3], poses[:, :, 3, 3] = T.transpose(3, 0, 2, 1), 1.0
    return poses.reshape(*q.shape[:-1], len(T), 4, 4)


def tip(chain: Chain, q: ArrayLike) -> Array:
    """Position of the tip (..., 3) [m], the origin of frame 9L of the da Vinci."""
    index = chain.names.index(chain.tip)
    body = poses_of_bodies(chain, np.asarray(q, float))[..., chain.body[index], :, :]
    return np.asarray((body @ chain.offset[index])[..., :3, 3])


def jacobian(
    chain: Chain, q: ArrayLike, frame: str | None = None, point: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[Array, Array]:
    """J_v and J_omega (..., 3, n) of a point fixed to a frame; the default point is the tip.

    `point` (3,) [m] is in the frame's axes, velocities in base axes.  (7.21)-(7.24), 6w7 for the second 5w6 of (4.20)
    """
    q = np.asarray(q, float)
    index = chain.names.index(frame or chain.tip)
    bodies, body = poses_of_bodies(chain, q), int(chain.body[index])
    T = bodies[..., body, :, :] @ chain.offset[index]
    return _jacobian(chain, bodies, q.shape[-1], body, T[..., :3, :3] @ np.asarray(point, float) + T[..., :3, 3])


def _jacobian(chain: Chain, T: Array, n: int, body: int, point: Array) -> tuple[Array, Array]:
    """J_v and J_omega (..., 3, n) of a point (..., 3) of a body; the point and the poses T are in base axes."""
    J_v, J_w = np.zeros((2, *T.shape[:-3], 3, n))
    for ancestor in to_base(chain, body):
        k, z, origin = chain.coordinate[ancestor - 1], T[..., ancestor, :3, 2], T[..., ancestor, :3, 3]
        if FIXED < k < n:
            J_v[..., k] += z if chain.slides[ancestor - 1] else np.cross(z, point - origin)
            J_w[..., k] += 0.0 if chain.slides[ancestor - 1] else z
    return J_v, J_w


def evaluate_in_blocks(function: Callable[[Any], NDArray[Any]], q: NDArray[Any]) -> NDArray[Any]:
    """Evaluate a function of poses (N, ...) in blocks: the poses of all bodies at all samples may take gigabytes."""
    return np.concatenate([function(q[i : i + POSES_AT_ONCE]) for i in range(0, max(len(q), 1), POSES_AT_ONCE)])


def to_base(chain: Chain, body: int) -> Iterator[int]:
    """Yield a body and its ancestors, without the base."""
    while body > 0:
        yield body
        body = int(chain.parent[body - 1])


def remote_centre(chain: Chain) -> Array:
    """The remote centre of motion (3,) [m]: the first two coordinates turn the instrument about this fixed point.

    On the last link that the second coordinate moves, it is the point that neither coordinate moves at q = 0, or the
    nearest to both axes.  The parallelogram keeps this point in place for all q.  Section 2.2
    """
    tip_body, n = int(chain.body[chain.names.index(chain.tip)]), min(chain.n, 2)
    body = next((body for body in to_base(chain, tip_body) if chain.coordinate[body - 1] == 1), tip_body)
    # v + w x p = 0 for both
    v, w = (J.T for J in _jacobian(chain, poses_of_bodies(chain, np.zeros(n)), n, body, np.zeros(3)))
    cross = np.cross(np.eye(3), w[:, None, :])  # row i of -[w]x: e_i x w
    return np.asarray(np.linalg.lstsq(np.concatenate(np.swapaxes(cross, 1, 2)), v.ravel(), rcond=None)[0])
