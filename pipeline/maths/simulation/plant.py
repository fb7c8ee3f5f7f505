"""The rigid body of an arm for the simulator: inertia, bias and tip for one configuration, compiled."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.maths.arrays import Array
from pipeline.maths.compiled import compiled
from pipeline.maths.constants import GRAVITY
from pipeline.maths.mechanics.bodies import Bodies
from pipeline.maths.mechanics.kinematics import FIXED, Chain
from pipeline.maths.mechanics.lanes import PackedArm, pack
from pipeline.maths.mechanics.sample import mass_and_bias, work
from pipeline.maths.simulation.closed_loop import Plant

Indices = NDArray[np.int64]


class ToTip(NamedTuple):
    """The links between the base and the tip, from the base outwards; every array is (L,).  (3.7)"""

    alpha: Array
    a: Array
    d: Array
    theta: Array
    slides: NDArray[np.bool_]
    coordinate: Indices


class PlantData(NamedTuple):
    """What the two functions of the plant are told: the arm, its scratch space, its rotors and the way to its tip."""

    arm: PackedArm
    work: Array
    rotors: Array  # eta^2 J_m (n,)
    to_tip: ToTip


def arm(chain: Chain, bodies: Bodies, rotors: Array) -> Plant:
    """The arm with as many joints as there are `rotors` (n,), eta^2 J_m; later coordinates stay at rest at 0."""
    n = len(rotors)
    packed, links, chain = pack(chain, bodies, n), list[int](), chain.reduced(n)
    frame = chain.names.index(chain.tip)
    while frame > 0:
        links.insert(0, frame - 1)
        frame = int(chain.parent[frame - 1])
    to_tip = ToTip(
        chain.alpha[links], chain.a[links], chain.d[links], chain.theta[links], chain.slides[links],
        chain.coordinate[links].astype(np.int64),
    )  # fmt: skip
    return Plant(_dynamics, _tip, PlantData(packed, work(packed), rotors.astype(np.float64), to_tip))


@compiled
def _dynamics(body: Any, q: Any, dq: Any, M: Any, b: Any) -> None:
    """Fill M, with the rotors', and b = C dq + G.  (A.12)"""
    mass_and_bias(body.arm, GRAVITY, q, dq, M, b, body.work)
    for i in range(len(q)):
        M[i, i] += body.rotors[i]


@compiled
def _tip(body: Any, q: Any, J: Any) -> Any:
    """Fill the Jacobian (3, n) of the tip, and give its position (3,).  (7.23)

    Every link turns about, or slides along, z of the frame that carries it: J = z x (tip - origin), or z.
    """
    links, n = body.to_tip, len(q)
    L = len(links.a)
    R, x, z, origin = np.zeros((3, 3)), np.zeros(3), np.empty((L, 3)), np.empty((L, 3))
    for k in range(3):
        R[k, k] = 1.0
    for link in range(L):
        i = links.coordinate[link]
        moved = q[i] if i != FIXED else 0.0
        for k in range(3):
            z[link, k], origin[link, k] = R[k, 2], x[k]
        if links.slides[link]:
            _onwards(links.theta[link], links.d[link] + moved, links.a[link], links.alpha[link], R, x)
        else:
            _onwards(links.theta[link] + moved, links.d[link], links.a[link], links.alpha[link], R, x)
    for k in range(3):
        for i in range(n):
            J[k, i] = 0.0
    for link in range(L):
        i = links.coordinate[link]
        if i != FIXED and links.slides[link]:
            for k in range(3):
                J[k, i] += z[link, k]
        elif i != FIXED:
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                J[k, i] += z[link, one] * (x[two] - origin[link, two]) - z[link, two] * (x[one] - origin[link, one])
    return x


@compiled
def _onwards(theta: float, d: float, a: float, alpha: float, R: Any, x: Any) -> None:
    """Go on from one frame, R (3, 3) at x (3,), to the next.  (3.7)"""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    for k in range(3):
        along, across, up = R[k, 0], R[k, 1], R[k, 2]
        outwards = c * along + s * across
        sideways = c * across - s * along
        x[k] += a * outwards + d * up
        R[k, 0], R[k, 1], R[k, 2] = outwards, ca * sideways + sa * up, ca * up - sa * sideways
