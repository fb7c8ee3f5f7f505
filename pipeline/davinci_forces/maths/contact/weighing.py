"""The mass whose gravity and inertia explain external efforts best, and how well they tell it.

    y_j = m x_j + b_j + e_j,    m = sum_j w_j x_j' y_j / sum_j w_j x_j' x_j,    w_j = 1 / sigma_j^2

x_j is what a kilogram asks of joint j and b_j an offset of the day, which takes the mean off both.  It is allowed only
where the column varies enough to be told from it.

The mass is a point fixed to one of the arm's links.  Section 7.5

    tau_load = m (J' (a + g up)),    a = J ddq + dJ/dt dq                                          (4.27), (7.30)

Positions are in metres from the remote centre, in axes fixed to the link that at q = 0 are the base axes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import frames, remote_centre, to_base
from davinci_forces.maths.mechanics.rigid_body import inverse_dynamics

PARTS = 6  # of a path, as the choice of a model leaves them out
# The share of a column's power that an offset has to leave: with less, it would more than double the standard error.
LEAST_VARYING = 0.25


class Rows(NamedTuple):
    """What one joint of one recording says of the mass, along its path."""

    x: Array  # (K,) what a kilogram asks for [effort/kg]
    y: Array  # (K,) external effort
    block: Integers  # (K,) of the path
    sigma: float = 1.0  # by how much the model errs there

    @property
    def varies(self) -> bool:
        """Whether an offset can be told from the load."""
        return bool(np.var(self.x) >= LEAST_VARYING * np.mean(self.x**2))

    def centred(self, kept: Booleans | None = None) -> tuple[Array, Array]:
        """Column and effort at some of the rows, without their means where the joint is allowed an offset."""
        x, y = (self.x, self.y) if kept is None else (self.x[kept], self.y[kept])
        return (x - x.mean(), y - y.mean()) if self.varies and len(x) else (x, y)


class Weighed(NamedTuple):
    """A mass and its standard error [kg]."""

    mass: float
    std: float


def weighed(rows: Sequence[Rows]) -> Weighed:
    """The mass that all joints together tell, and its standard error by leaving out a sixth of the path in turn.

    What a model leaves repeats with the path: sixths of it are about independent of each other, samples and periods are
    not.  (Jackknife; Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 11)
    """
    without = np.array([_mass(rows, block) for block in range(PARTS)])
    spread = (PARTS - 1) / PARTS * np.sum((without - without.mean()) ** 2)
    return Weighed(_mass(rows), float(np.sqrt(spread)))


def _mass(rows: Sequence[Rows], without: int | None = None) -> float:
    up = down = 0.0
    for row in rows:
        x, y = row.centred(None if without is None else row.block != without)
        up += float(x @ y) / row.sigma**2
        down += float(x @ x) / row.sigma**2
    return up / down if down > 0 else float("nan")


def offset(row: Rows, mass: float) -> float:
    """The offset b of a joint beside a mass; 0 where it is allowed none."""
    return float(np.mean(row.y - mass * row.x)) if row.varies else 0.0


def residual(row: Rows, mass: float) -> Array:
    """What a mass and the offset leave of the effort (K,)."""
    return np.asarray(row.y - mass * row.x - offset(row, mass))


def model_errors(rows: Sequence[Rows]) -> float:
    """The root mean square of what free motion leaves of one joint, over its recordings, each counting alike."""
    squares = [np.mean(residual(row, 0.0) ** 2) for row in rows]
    exact = 1e-9 * max(float(np.abs(row.x).max()) for row in rows)  # of a model without any error
    return max(float(np.sqrt(np.mean(squares))), exact)


def better(rows: Sequence[Rows], others: Sequence[Rows]) -> float:
    """By how many standard errors one column explains the same efforts better than another does; negative if worse."""
    apart = _squares(others) - _squares(rows)
    spread = np.sqrt(PARTS / (PARTS - 1) * np.sum((apart - apart.mean()) ** 2))
    return float(apart.sum() / spread) if spread > 0 else 0.0


def _squares(rows: Sequence[Rows]) -> Array:
    """The weighted squares that the best mass leaves in each block (B,)."""
    mass = _mass(rows)
    return np.asarray(np.sum([np.bincount(r.block, (residual(r, mass) / r.sigma) ** 2, PARTS) for r in rows], axis=0))


def widening(free: Sequence[Weighed], common: float) -> float:
    """The factor, at least 1, by which masses of free motion exceed their stated errors: they should be 0.

    `common` is the standard error that all of them share, of the fit.  (Birge, 1932)
    """
    ratios = [w.mass**2 / (w.std**2 + common**2) for w in free if w.std > 0]
    return max(1.0, float(np.sqrt(np.mean(ratios)))) if ratios else 1.0


def moved_with(chain: Chain, coordinate: int) -> str:
    """The link that moves with a coordinate and carries the tip: of a parallelogram, the one that turns about the
    remote centre.

    Raises
    ------
    ValueError
        If the coordinate moves nothing between base and tip.
    """
    for body in to_base(chain, int(chain.body[chain.names.index(chain.tip)])):
        if chain.coordinate[body - 1] == coordinate:
            return chain.links[body - 1]
    raise ValueError(f"coordinate {coordinate} does not move {chain.tip}")


def mirrored(position: ArrayLike) -> Array:
    """The position (3,) at the same height on the other side of the link: turned by half a turn about the vertical."""
    return np.asarray(position, float) * (-1.0, -1.0, 1.0)


def unit_load(chain: Chain, link: str, position: ArrayLike, q: Array, dq: Array, ddq: Array) -> Array:
    """The effort (N, n) that a mass of 1 kg, hung on a link at a position (3,), asks of the first n coordinates along
    a motion (N, n): gravity and inertia.  A mass m adds m times it to the effort that the motion takes.
    """
    n, L = q.shape[1], len(chain.links)
    masses, centres = np.zeros(L), np.zeros((L, 3))
    which = chain.links.index(link)
    masses[which], centres[which] = 1.0, in_link(chain, link, position, n)
    hung = Bodies(masses, centres, np.zeros((L, 3, 3)), np.zeros(L, np.int64))
    return inverse_dynamics(chain, hung, q, dq, ddq)


def in_link(chain: Chain, link: str, position: ArrayLike, n: int) -> Array:
    """The same position (3,) in the link's own frame [m], which does not depend on q."""
    frame = chain.names.index(link)
    own = frames(chain, np.zeros(n))[frame] @ np.linalg.inv(chain.offset[frame])
    at = np.append(remote_centre(chain) + np.asarray(position, float), 1.0)
    return np.asarray(np.linalg.solve(own, at)[:3])
