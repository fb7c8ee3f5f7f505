"""The dynamics of a tree of links: motions are computed from the base outwards, wrenches from the tips inwards.

Recursive Newton-Euler (Featherstone 2008, chapter 5) and the regressor; `link` has the equations of one link.
Where several links share a coordinate, its effort is the sum of theirs.

The same source runs on numpy arrays and in compiled loops (`kernels`).  The last axis of every array has S samples.
In compiled code `samples` is `range(S)`; in numpy it has one element, a slice of all samples.  `joints` (n + 1, 5, S)
has cos q, sin q, q, dq, ddq of each coordinate.  Its last row is 0, for links that no coordinate moves: they count as
sliding by 0, so cos q and sin q are not used.  `scratch` (bodies, numbers, S) has the intermediate results of every
body: the base is body 0, link i is body i + 1, and `tree.parent[i]` is a number of a body.
The caller sets it to 0 before its first use.
"""

from collections.abc import Iterable
from typing import Any

from davinci_forces.maths.mechanics import link
from davinci_forces.maths.mechanics.chain import Tree
from davinci_forces.maths.mechanics.link import Vector, dot, plus

Samples = Iterable[Any]


def vector(body: Any, first: int, s: Any) -> Vector:
    """Read a vector from three numbers of a body (numbers, S), from index `first` on."""
    return body[first, s], body[first + 1, s], body[first + 2, s]


def store(body: Any, first: int, s: Any, x: Vector) -> None:
    """Store a vector in three numbers of a body (numbers, S), from index `first` on."""
    body[first, s], body[first + 1, s], body[first + 2, s] = x


def fill(signal: Any, value: float, samples: Samples) -> None:
    """Set all samples of a signal (S,) to one value."""
    for s in samples:
        signal[s] = value


def motions(tree: Tree, gravity: float, joints: Any, scratch: Any, samples: Samples) -> None:
    """Store the motion (w, dw, a) of every link in the first 9 numbers of its body."""
    for k in range(3):
        fill(scratch[0, 6 + k], gravity * tree.up[k], samples)  # gravity acts like an upward acceleration g of the base
    for i in range(len(tree.parent)):
        constants, slides, joint = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]]
        parent, body = scratch[tree.parent[i]], scratch[i + 1]
        for s in samples:
            motion = vector(parent, 0, s), vector(parent, 3, s), vector(parent, 6, s)
            cos_sin = joint[0, s], joint[1, s]
            w, dw, a = link.link_motion(constants, slides, cos_sin, joint[2, s], joint[3, s], joint[4, s], motion)
            store(body, 0, s, w)
            store(body, 3, s, dw)
            store(body, 6, s, a)


def inverse_dynamics(tree: Tree, gravity: float, joints: Any, scratch: Any, tau: Any, samples: Samples) -> None:
    """Store the effort of each coordinate in tau (n, S); with gravity 0 and ddq 0 the effort is C dq.  (4.27)

    `scratch` has 15 numbers of each body: motion and wrench.
    """
    motions(tree, gravity, joints, scratch, samples)
    for i in range(len(tree.parent)):
        constants, body = tree.rows[i], scratch[i + 1]
        for s in samples:
            f, n = link.wrench_of(constants, (vector(body, 0, s), vector(body, 3, s), vector(body, 6, s)))
            store(body, 9, s, f)
            store(body, 12, s, n)
    for k in range(tree.n):
        fill(tau[k], 0.0, samples)
    for i in range(len(tree.parent) - 1, -1, -1):
        constants, slides, joint = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]]
        parent, body = scratch[tree.parent[i]], scratch[i + 1]
        total, effort = tau[tree.coordinate[i]], body[11 if slides else 14]  # the force along z, or the moment about z
        for s in samples:
            total[s] += effort[s]
        for s in samples:
            wrench = vector(body, 9, s), vector(body, 12, s)
            f, n = link.wrench_in_parent_frame(constants, slides, (joint[0, s], joint[1, s]), joint[2, s], wrench)
            store(parent, 9, s, plus(vector(parent, 9, s), f))
            store(parent, 12, s, plus(vector(parent, 12, s), n))


def mass_matrix(tree: Tree, joints: Any, scratch: Any, M: Any, samples: Samples) -> None:
    """Fill the lower triangle of M (n, n, S), the sum over links of J' I J with a link's spatial inertia I.  (4.38)

    `scratch` has n blocks of L + 1 rows of 6 numbers: the velocity of every body if only coordinate k moves, with unit
    velocity.  One more row has the momentum of one link.
    """
    bodies, momentum = len(tree.parent) + 1, scratch[tree.n * (len(tree.parent) + 1)]
    for k in range(tree.n):
        for o in range(k + 1):
            fill(M[k, o], 0.0, samples)
    for i in range(bodies - 1):
        constants, slides, joint = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]]
        for k in range(tree.n):
            if tree.moves[i][k]:
                unit = 1.0 if k == tree.coordinate[i] else 0.0
                parent, body = scratch[k * bodies + tree.parent[i]], scratch[k * bodies + i + 1]
                for s in samples:
                    cos_sin, velocity = (joint[0, s], joint[1, s]), (vector(parent, 0, s), vector(parent, 3, s))
                    w, v = link.link_velocity(constants, slides, cos_sin, joint[2, s], unit, velocity)
                    store(body, 0, s, w)
                    store(body, 3, s, v)
                    angular, linear = link.momentum(constants, (w, v))
                    store(momentum, 0, s, angular)
                    store(momentum, 3, s, linear)
                for o in range(k + 1):
                    if tree.moves[i][o]:
                        other = scratch[o * bodies + i + 1]
                        for s in samples:
                            moment = dot(vector(other, 0, s), vector(momentum, 0, s))
                            M[k, o, s] += moment + dot(vector(other, 3, s), vector(momentum, 3, s))


def regressor(tree: Tree, gravity: float, joints: Any, scratch: Any, Y: Any, samples: Samples) -> None:
    """Store the ten columns of link i and coordinate k in Y[k, i] (10, S), if the coordinate moves the link.  (6.3)

    `scratch` has n + 1 blocks of L + 1 rows (the base and L links) of 9 numbers.  Block 0 has the motion of every body.
    Block k + 1 has the velocity of every body if only coordinate k moves, with unit velocity: a column of its Jacobian.
    """
    motions(tree, gravity, joints, scratch, samples)
    bodies = len(tree.parent) + 1
    for i in range(bodies - 1):
        constants, slides, joint, motion = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]], scratch[i + 1]
        for k in range(tree.n):
            if tree.moves[i][k]:
                unit, first = (1.0 if k == tree.coordinate[i] else 0.0), (k + 1) * bodies
                parent, body, columns = scratch[first + tree.parent[i]], scratch[first + i + 1], Y[k, i]
                for s in samples:
                    cos_sin, parent_velocity = (joint[0, s], joint[1, s]), (vector(parent, 0, s), vector(parent, 3, s))
                    J = link.link_velocity(constants, slides, cos_sin, joint[2, s], unit, parent_velocity)
                    store(body, 0, s, J[0])
                    store(body, 3, s, J[1])
                    body_motion = vector(motion, 0, s), vector(motion, 3, s), vector(motion, 6, s)
                    ten = link.columns(body_motion, J)
                    for c in range(10):
                        columns[c, s] = ten[c]
