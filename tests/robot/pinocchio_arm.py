"""The arm as a Pinocchio model: a tree in which every link that moves has a joint of its own.

The parallelogram's three joints are then driven alike: q_tree = E q, tau = E' tau_tree, M = E' M_tree E.
"""

from typing import Any, NamedTuple

import numpy as np

from pipeline.maths.mechanics.bodies import Bodies
from pipeline.maths.mechanics.kinematics import FIXED, Chain


class Tree(NamedTuple):
    model: Any
    data: Any
    E: np.ndarray  # (joints of the tree, n)
    frames: list[int]  # Pinocchio's number of each of the chain's frames after the base


def tree(pin: Any, chain: Chain, bodies: Bodies, n: int) -> Tree:
    chain, bodies = chain.reduced(n), bodies.counted(n)
    model = pin.Model()
    place: list[tuple[int, Any]] = [(0, pin.SE3.Identity())]  # joint that carries each frame, and the frame in it
    E, frames = [], []
    for i, (name, parent) in enumerate(zip(chain.names[1:], chain.parent, strict=True)):
        c, s = np.cos(chain.theta[i]), np.sin(chain.theta[i])
        before = pin.SE3(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([0, 0, chain.d[i]]))
        c, s = np.cos(chain.alpha[i]), np.sin(chain.alpha[i])
        after = pin.SE3(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([chain.a[i], 0, 0]))
        carrier, local = place[parent]
        if chain.coordinate[i] == FIXED:
            joint, at = carrier, local * before * after
        else:
            kind = pin.JointModelPZ() if chain.slides[i] else pin.JointModelRZ()
            joint, at = model.addJoint(carrier, kind, local * before, name), after
            E.append(np.eye(n)[chain.coordinate[i]])
        place.append((joint, at))
        inertia = pin.Inertia(bodies.masses[i], bodies.centres[i], bodies.inertias[i])
        model.appendBodyToJoint(joint, inertia, at)
        frames.append(model.addFrame(pin.Frame(f"frame {name}", joint, 0, at, pin.FrameType.OP_FRAME)))
    return Tree(model, model.createData(), np.array(E), frames)
