"""What a mass that hangs on an arm asks of its joints: a point mass fixed to one of its links.  Section 7.5

    tau_load = m (J' (a + g up)),    a = J ddq + dJ/dt dq                                          (4.27), (7.30)

Positions are in metres from the remote centre, in axes fixed to the link that at q = 0 are the base axes.
"""

import numpy as np
from numpy.typing import ArrayLike

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import frames, remote_centre
from davinci_forces.maths.mechanics.rigid_body import inverse_dynamics


def moved_with(chain: Chain, coordinate: int) -> str:
    """The link that moves with a coordinate and carries the tip: of a parallelogram, the one that turns about the
    remote centre.

    Raises
    ------
    ValueError
        If the coordinate moves nothing between base and tip.
    """
    body = int(chain.body[chain.names.index(chain.tip)])
    while body > 0:
        if chain.coordinate[body - 1] == coordinate:
            return chain.links[body - 1]
        body = int(chain.parent[body - 1])
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
