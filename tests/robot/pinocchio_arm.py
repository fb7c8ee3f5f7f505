"""The arm as a Pinocchio model: a tree in which every link that moves has a joint of its own.

The parallelogram's three joints are then driven alike: q_tree = E q, tau = E' tau_tree, M = E' M_tree E.
"""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import FIXED, Chain


class Tree(NamedTuple):
    model: Any
    data: Any
    E: np.ndarray  # (joints of the tree, n)
    frames: list[int]  # Pinocchio's number of each of the chain's frames after the base


def tree(pin: Any, chain: Chain, bodies: Bodies, n: int) -> Tree:
    chain, bodies = chain.with_coordinates(n), bodies.with_coordinates(n)
    model = pin.Model()
    place: list[tuple[int, Any]] = [(0, pin.SE3.Identity())]  # joint that carries each body, and the body in it
    E = []
    for i, (name, parent) in enumerate(zip(chain.links, chain.parent, strict=True)):
        carrier, local = place[parent]
        at = local * pin.SE3(chain.placement[i])
        if chain.coordinate[i] == FIXED:
            place.append((carrier, at))
        else:
            kind = pin.JointModelPZ() if chain.slides[i] else pin.JointModelRZ()
            place.append((model.addJoint(carrier, kind, at, name), pin.SE3.Identity()))
            E.append(np.eye(n)[chain.coordinate[i]])
        joint, local = place[-1]
        model.appendBodyToJoint(joint, pin.Inertia(bodies.masses[i], bodies.centres[i], bodies.inertias[i]), local)
    frames = []
    for name, body, offset in zip(chain.names[1:], chain.body[1:], chain.offset[1:], strict=True):
        joint, local = place[body]
        at = local * pin.SE3(offset)
        frames.append(model.addFrame(pin.Frame(f"frame {name}", joint, 0, at, pin.FrameType.OP_FRAME)))
    return Tree(model, model.createData(), np.array(E), frames)
