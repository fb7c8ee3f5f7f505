"""The rigid body of an arm for the simulator: inertia, bias and tip for one configuration, compiled."""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compiled
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kernels import mass_and_bias, place_and_jacobian
from davinci_forces.maths.mechanics.tree import Tree, folded, tree_of
from davinci_forces.maths.simulation.closed_loop import Plant


class PlantData(NamedTuple):
    """What the two functions of the plant are told: the arm, its rotors, and what its tip is fixed to."""

    tree: Tree
    rest: Array  # no acceleration (n,)
    rotors: Array  # eta^2 J_m (n,)
    body: int  # that carries the tip
    tip: tuple[float, float, float]  # in that body's frame [m]


def arm(chain: Chain, bodies: Bodies, rotors: Array) -> Plant:
    """The arm with as many joints as there are `rotors` (n,), eta^2 J_m; later coordinates stay at rest at 0."""
    n = len(rotors)
    chain, parameters = folded(chain.reduced(n), bodies.parameters(n).reshape(-1, 10))
    frame = chain.names.index(chain.tip)
    x, y, z = chain.offset[frame, :3, 3].tolist()
    data = PlantData(
        tree_of(chain, parameters), np.zeros(n), rotors.astype(np.float64), int(chain.body[frame]), (x, y, z)
    )
    return Plant(dynamics, _tip, data)


@compiled
def dynamics(body: Any, q: Any, dq: Any, M: Any, b: Any) -> None:
    """Fill M, with the rotors', and b = C dq + G.  (A.12)"""
    mass_and_bias(body.tree, GRAVITY, q, dq, body.rest, M, b)
    for i in range(len(q)):
        M[i, i] += body.rotors[i]


@compiled
def _tip(body: Any, q: Any, J: Any) -> Any:
    """Fill the Jacobian (3, n) of the tip, and give its position (3,).  (7.23)"""
    return np.array(place_and_jacobian(body.tree, body.body, body.tip, q, J))
