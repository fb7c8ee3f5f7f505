"""Limits that couple the joints of an arm: efforts of the joints, and obstacles to its frames.

Their excess is a share of the largest effort, or a depth in m; the limits hold where it is not positive.  Efforts are
those of the links' weight and inertia.  Obstacles concern the origins of the moving frames, not the bodies of links, so
a trajectory within these limits need not be free of collisions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, motion
from davinci_forces.maths.mechanics.bodies import RANDOM_SAMPLES
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import frames, poses_of_bodies
from davinci_forces.maths.mechanics.rigid_body import compiled_regressor

INSTANTS = 10_000  # of a period at which the excess is computed; between them it is bounded
STRIDE = 20  # instants of which one is tried first: it shows nearly every motion that breaks a limit
MIN_FRAME_TRAVEL = 1e-9  # [m] of a frame that moves; rounding is smaller
SHRINKAGES = 20  # bisections of the amplitude, to a millionth
Box = tuple[float, float, float, float, float, float]  # lowest x, y, z and highest x, y, z [m], in base axes


@dataclass(frozen=True)
class Obstacles:
    """Where no frame may be: below a floor, and inside boxes."""

    floor: float = -math.inf  # z [m], in base axes
    boxes: tuple[Box, ...] = ()

    @property
    def present(self) -> bool:
        """Whether there is any obstacle."""
        return bool(self.boxes) or math.isfinite(self.floor)

    def depth(self, points: Array) -> Array:
        """The depth (..., 1 + boxes) [m] of points (..., 3) below the floor and inside each box; negative outside."""
        corners = np.array(self.boxes, float).reshape(-1, 2, 3)
        inside = np.minimum(points[..., None, :] - corners[:, 0], corners[:, 1] - points[..., None, :]).min(axis=-1)
        return np.concatenate([np.maximum(self.floor - points[..., 2:], -1e3), inside], axis=-1)


NO_OBSTACLES = Obstacles()


@dataclass(frozen=True, eq=False)
class ArmLimits:
    """The chain of an arm, its largest efforts (n,) where its masses are known, and the obstacles around it."""

    chain: Chain
    parameters: Array | None = None  # inertial parameters of the links (10 L,)
    efforts: tuple[float, ...] = ()  # of each joint [N m or N], in either direction; infinite without a limit
    obstacles: Obstacles = NO_OBSTACLES

    @property
    def limits_effort(self) -> bool:
        """Whether efforts are limited and can be computed."""
        return self.parameters is not None and bool(np.isfinite(self.efforts).any())

    def excess(self, q: Array, Y: Array) -> Array:
        """The excess (..., m) over each limit at q (..., n) with regressor Y (..., n, 10 L); m = 0 without limits."""
        share = np.empty((*q.shape[:-1], 0))
        if self.parameters is not None and self.limits_effort:
            share = Y @ self.parameters / np.array(self.efforts)
        return np.concatenate([share - 1, -share - 1, self.depth(q)], axis=-1)

    def depth(self, q: Array) -> Array:
        """The depth (..., d) [m] of each moving frame in each obstacle at q (..., n): the last part of the excess."""
        if not self.obstacles.present:
            return np.empty((*q.shape[:-1], 0))
        poses, offset = poses_of_bodies(self.chain, q), self.chain.offset[self._moving, :, 3]
        points = np.einsum("...fij,fj->...fi", poses[..., self.chain.body[self._moving], :3, :], offset)
        return self.obstacles.depth(points).reshape(*q.shape[:-1], -1)

    def hold(self, q: Array, dq: Array, ddq: Array) -> bool:
        """Whether the limits hold along a motion (K, n), also between its samples."""
        if not (self.limits_effort or self.obstacles.present):
            return True
        few = slice(None, None, STRIDE)
        if (self.excess(q[few], compiled_regressor(self.chain, q[few], dq[few], ddq[few])) > 0).any():
            return False
        excess = self.excess(q, compiled_regressor(self.chain, q, dq, ddq))
        # Between two samples an excess is above theirs by no more than its largest change from sample to sample.
        return bool((excess.max(axis=0) + np.abs(np.diff(excess, axis=0)).max(axis=0) <= 0).all())

    @cached_property
    def _moving(self) -> NDArray[np.intp]:
        """The frames whose origin moves."""
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (RANDOM_SAMPLES, self.chain.n))
        return np.flatnonzero(np.ptp(frames(self.chain, q)[..., :3, 3], axis=0).max(axis=-1) > MIN_FRAME_TRAVEL)


def shrink_to_arm_limits(limits: ArmLimits, series: Sequence[Fourier]) -> list[Fourier] | None:
    """Shrink all series towards rest at their means until the limits hold at every instant; None if rest breaks one."""
    t = np.linspace(0.0, series[0].period, INSTANTS + 1)
    q, dq, ddq = (np.stack(x, axis=-1) for x in zip(*(motion(s, t) for s in series), strict=True))
    rest = np.array([s.a0 for s in series])

    def hold_at(scale: float) -> bool:
        return limits.hold(rest + scale * (q - rest), scale * dq, scale * ddq)

    if hold_at(1.0):
        return list(series)
    low, high = 0.0, 1.0
    for _ in range(SHRINKAGES):
        middle = (low + high) / 2
        low, high = (middle, high) if hold_at(middle) else (low, middle)
    return [Fourier.from_coefficients(np.r_[s.a0, low * s.x[1:]], s.period) for s in series] if low > 0 else None
