"""Where every frame of an arm is, and how it moves: Denavit-Hartenberg chains that branch and share coordinates.

    T(i-1 to i) = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i)                                            (3.7)

A chain says for each link which generalised coordinate moves it, if any.  One coordinate may move several links (the
parallelogram's three share q2), and several links may hang on one frame (the two jaws).  Frame 0 is the base; link l
(counted from 0) carries frame l + 1.

Shapes: `q` is (..., n) in rad or m, with any leading axes; n below the chain's own holds the later coordinates at 0.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.maths.arrays import Array
from pipeline.maths.mechanics.spatial import contract, motion_cross

FIXED = -1  # the coordinate of a link that nothing moves


@dataclass(frozen=True, eq=False)
class Chain:
    """The links of an arm: DH parameters (L,), and what moves and what carries each.  Table 3.1"""

    alpha: Array  # [rad]
    a: Array  # [m]
    d: Array  # [m] at q = 0
    theta: Array  # [rad] at q = 0
    slides: NDArray[np.bool_]  # whether the coordinate moves d rather than theta
    coordinate: NDArray[np.int64]  # index in q of the coordinate that moves it, or FIXED
    parent: NDArray[np.int64]  # frame that carries it
    names: tuple[str, ...]  # of the frames, the base first: (L + 1,)
    tip: str  # frame whose origin is the tip
    n: int  # coordinates

    def reduced(self, n: int) -> "Chain":
        """The same arm with all coordinates after the first n held at 0.

        Raises
        ------
        ValueError
            If it has fewer than n coordinates.
        """
        if n == self.n:
            return self
        if not 0 < n < self.n:
            raise ValueError(f"the chain has {self.n} coordinates, and q has {n}")
        return replace(self, n=n, coordinate=np.where(self.coordinate < n, self.coordinate, FIXED))

    @cached_property
    def moves(self) -> Array:
        """Which coordinate moves each link: ones and zeros (L, n)."""
        return np.asarray(self.coordinate[:, None] == np.arange(self.n), float)

    @cached_property
    def carries(self) -> Array:
        """Which links lie between the base and each frame: ones and zeros (L + 1, L)."""
        L = len(self.parent)
        path = np.zeros((L + 1, L))
        for link, parent in enumerate(self.parent):
            path[link + 1] = path[parent]
            path[link + 1, link] = 1.0
        return path


def frames(chain: Chain, q: ArrayLike) -> Array:
    """The pose of every frame in the base frame, as homogeneous matrices (..., L + 1, 4, 4) [m].  (3.6), (4.30)"""
    q = np.asarray(q, float)
    chain = chain.reduced(q.shape[-1])
    moved = q @ chain.moves.T
    local = _transforms(chain, chain.theta + moved * ~chain.slides, chain.d + moved * chain.slides)
    T = np.empty((*q.shape[:-1], len(chain.names), 4, 4))
    T[..., 0, :, :] = np.eye(4)
    for link, parent in enumerate(chain.parent):
        T[..., link + 1, :, :] = T[..., parent, :, :] @ local[..., link, :, :]
    return T


def _transforms(chain: Chain, theta: Array, d: Array) -> Array:
    """From each frame to the one that carries it (..., L, 4, 4).  (3.7)"""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(chain.alpha), np.sin(chain.alpha)
    T = np.zeros((*theta.shape, 4, 4))
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 2], T[..., 0, 3] = c, -ca * s, sa * s, chain.a * c
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 2], T[..., 1, 3] = s, ca * c, -sa * c, chain.a * s
    T[..., 2, 1], T[..., 2, 2], T[..., 2, 3] = sa, ca, d
    T[..., 3, 3] = 1.0
    return T


def tip(chain: Chain, q: ArrayLike) -> Array:
    """Where the tip is: the origin of frame 9L of the da Vinci (..., 3) [m]."""
    return np.asarray(frames(chain, q)[..., chain.names.index(chain.tip), :3, 3])


def jacobian(
    chain: Chain, q: ArrayLike, frame: str | None = None, point: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[Array, Array]:
    """J_v and J_omega (..., 3, n) of a point fixed to a frame, `point` (3,) in its axes [m]; of the tip by default.

    Velocities are in the base axes.  (7.21)-(7.24), with 6w7 for the second 5w6 of (4.20)
    """
    q = np.asarray(q, float)
    chain = chain.reduced(q.shape[-1])
    T = frames(chain, q)
    index = chain.names.index(frame or chain.tip)
    at = T[..., index, :3, :3] @ np.asarray(point, float) + T[..., index, :3, 3]
    J = spatial_jacobians(chain, T)[..., index, :, :]
    J_w = J[..., :3, :]
    return J[..., 3:, :] + np.cross(J_w, at[..., :, None], axis=-2), J_w


def screws(chain: Chain, T: Array) -> Array:
    """What one unit of each link's own motion does: [omega, v of the point at the base's origin] (..., L, 6).

    It turns about, or slides along, z of the frame that carries it; a fixed link does nothing.
    """
    carrier = T[..., chain.parent, :, :]
    z, origin = carrier[..., :3, 2], carrier[..., :3, 3]
    slides = chain.slides[:, None]
    S = np.concatenate([np.where(slides, 0.0, z), np.where(slides, z, np.cross(origin, z))], axis=-1)
    return np.asarray(S * (chain.coordinate != FIXED)[:, None])


def spatial_jacobians(chain: Chain, T: Array) -> Array:
    """The spatial velocity of every frame by dq, [omega, v at the base's origin] (..., L + 1, 6, n)."""
    return contract("fl,...lc,lk->...fck", chain.carries, screws(chain, T), chain.moves)


def jacobian_rates(chain: Chain, T: Array, dq: Array) -> Array:
    """The time derivatives of the links' spatial Jacobians (..., L, 6, n): each link carries its own screw along."""
    S = screws(chain, T)
    own = S * (dq @ chain.moves.T)[..., None]
    carried = contract("fl,...lc->...fc", chain.carries, own)[..., chain.parent, :]
    S_dot = contract("...lcd,...ld->...lc", motion_cross(carried), S)
    return contract("fl,...lc,lk->...fck", chain.carries[1:], S_dot, chain.moves)


def remote_centre(chain: Chain) -> Array:
    """The point (3,) [m] about which the first two coordinates turn whatever carries the instrument.

    It is the point of the link that they move last which neither of them moves at q = 0; that it stays where it is
    for all q is a property of the parallelogram.  Section 2.2
    """
    arm = chain.reduced(2)
    link = int(np.flatnonzero(arm.coordinate == 1)[-1])
    J = spatial_jacobians(arm, frames(arm, np.zeros(2)))[link + 1]
    w, v = J[:3].T, J[3:].T  # v + w x p = 0 for both
    cross = np.cross(np.eye(3), w[:, None, :])  # row i of -[w]x: e_i x w
    return np.asarray(np.linalg.lstsq(np.concatenate(np.swapaxes(cross, 1, 2)), v.ravel(), rcond=None)[0])
