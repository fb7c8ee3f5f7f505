"""The dynamics of a tree of links, from that of one: outwards from the base with motions, inwards with wrenches.

Recursive Newton-Euler and composite rigid bodies (Featherstone 2008, chapters 5 and 6), and the regressor.  Where a
coordinate moves several links, it collects the effort of all of them.

One source for numpy and for compiled loops (`kernels`).  The last axis of every array has S samples, and `samples` are
the indices to compute with: one slice of all in numpy, `range(S)` where it is compiled.  `joints` (n + 1, 5, S) holds
cos q, sin q, q, dq, ddq of each coordinate, and zeros for what never moves.  `work` (bodies, numbers, S) is space for
what is kept of every body in between, the base first, and 0 before its first use.
"""

from collections.abc import Iterable
from typing import Any

from davinci_forces.maths.mechanics import link
from davinci_forces.maths.mechanics.chain import Tree
from davinci_forces.maths.mechanics.link import Vector, plus

Samples = Iterable[Any]


def vector(numbers: Any, first: int, s: Any) -> Vector:
    """Three numbers of a body, from `first` on."""
    return numbers[first, s], numbers[first + 1, s], numbers[first + 2, s]


def put(numbers: Any, first: int, s: Any, x: Vector) -> None:
    """Keep three numbers of a body, from `first` on."""
    numbers[first, s], numbers[first + 1, s], numbers[first + 2, s] = x


def fill(numbers: Any, value: float, samples: Samples) -> None:
    """Give all samples one value."""
    for s in samples:
        numbers[s] = value


def add(total: Any, wrench: Any, slides: bool, samples: Samples) -> None:
    """Add what a joint exerts of a wrench on its link: its force along z, or its moment about z."""
    part = wrench[2 if slides else 5]
    for s in samples:
        total[s] += part[s]


def motions(tree: Tree, gravity: float, joints: Any, work: Any, samples: Samples) -> None:
    """Put the motion of every link into the first 9 numbers of its body."""
    fill(work[0, 8], gravity, samples)  # standing still feels like accelerating upwards with g
    for i in range(len(tree.parent)):
        row, slides, joint = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]]
        carrier, body = work[tree.parent[i]], work[i + 1]
        for s in samples:
            motion = vector(carrier, 0, s), vector(carrier, 3, s), vector(carrier, 6, s)
            turn = joint[0, s], joint[1, s]
            w, e, a = link.link_motion(row, slides, turn, joint[2, s], joint[3, s], joint[4, s], motion)
            put(body, 0, s, w)
            put(body, 3, s, e)
            put(body, 6, s, a)


def inverse_dynamics(tree: Tree, gravity: float, joints: Any, work: Any, tau: Any, samples: Samples) -> None:
    """Put the effort of each coordinate into tau (n, S); with gravity 0, and ddq 0, it is C dq.  (4.27)

    The work space has 15 numbers of each body: motion and wrench.
    """
    motions(tree, gravity, joints, work, samples)
    for i in range(len(tree.parent)):
        row, body = tree.rows[i], work[i + 1]
        for s in samples:
            f, n = link.wrench_of(row, (vector(body, 0, s), vector(body, 3, s), vector(body, 6, s)))
            put(body, 9, s, f)
            put(body, 12, s, n)
    for k in range(tree.n):
        fill(tau[k], 0.0, samples)
    for i in range(len(tree.parent) - 1, -1, -1):
        row, slides, joint = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]]
        carrier, body = work[tree.parent[i]], work[i + 1]
        add(tau[tree.coordinate[i]], body[9:], slides, samples)
        for s in samples:
            wrench = vector(body, 9, s), vector(body, 12, s)
            f, n = link.carrier_wrench(row, slides, (joint[0, s], joint[1, s]), joint[2, s], wrench)
            put(carrier, 9, s, plus(vector(carrier, 9, s), f))
            put(carrier, 12, s, plus(vector(carrier, 12, s), n))


def mass_matrix(tree: Tree, joints: Any, work: Any, M: Any, samples: Samples) -> None:
    """Fill M (n, n, S).  (4.38)

    The work space has 9 numbers of each body: first moment and inertia of all that it carries.  The base's are those
    of the wrench that one unit of a joint's acceleration takes, on its way inwards.
    """
    wrench = work[0]
    for k in range(tree.n):
        for o in range(tree.n):
            fill(M[k, o], 0.0, samples)
    for i in range(len(tree.parent)):
        for c in range(9):
            fill(work[i + 1, c], tree.rows[i][13 + c], samples)
    for i in range(len(tree.parent) - 1, -1, -1):
        k, slides, m, body = tree.coordinate[i], tree.slides[i], tree.carried[i], work[i + 1]
        for s in samples:
            f, n = link.unit_wrench(slides, m, (vector(body, 0, s), vector(body, 3, s), vector(body, 6, s)))
            put(wrench, 0, s, f)
            put(wrench, 3, s, n)
        add(M[k, k], wrench, slides, samples)
        if tree.parent[i] > 0:
            row, joint, carrier = tree.rows[i], joints[k], work[tree.parent[i]]
            for s in samples:
                inertia = vector(body, 0, s), vector(body, 3, s), vector(body, 6, s)
                h, upper, lower = link.moved_inertia(slides, (joint[0, s], joint[1, s]), joint[2, s], m, inertia)
                put(body, 0, s, h)
                put(body, 3, s, upper)
                put(body, 6, s, lower)
            for s in samples:
                inertia = vector(body, 0, s), vector(body, 3, s), vector(body, 6, s)
                h, upper, lower = link.carried_inertia(row, m, inertia)
                put(carrier, 0, s, plus(vector(carrier, 0, s), h))
                put(carrier, 3, s, plus(vector(carrier, 3, s), upper))
                put(carrier, 6, s, plus(vector(carrier, 6, s), lower))
        j = i
        while tree.parent[j] > 0:
            row, slides, joint = tree.rows[j], tree.slides[j], joints[tree.coordinate[j]]
            for s in samples:
                push = vector(wrench, 0, s), vector(wrench, 3, s)
                f, n = link.carrier_wrench(row, slides, (joint[0, s], joint[1, s]), joint[2, s], push)
                put(wrench, 0, s, f)
                put(wrench, 3, s, n)
            j = tree.parent[j] - 1
            add(M[k, tree.coordinate[j]], wrench, tree.slides[j], samples)
            add(M[tree.coordinate[j], k], wrench, tree.slides[j], samples)


def regressor(tree: Tree, gravity: float, joints: Any, work: Any, Y: Any, samples: Samples) -> None:
    """Put the ten columns of link i and coordinate k, where it moves the link, into Y[k, i] (10, S).  (6.3)

    The work space has 9 numbers of (n + 1) (L + 1) bodies: their motions, and then, coordinate by coordinate, their
    velocities by one unit of it.
    """
    motions(tree, gravity, joints, work, samples)
    bodies = len(tree.parent) + 1
    for i in range(bodies - 1):
        row, slides, joint, motion = tree.rows[i], tree.slides[i], joints[tree.coordinate[i]], work[i + 1]
        for k in range(tree.n):
            if tree.moves[i][k]:
                unit, first = (1.0 if k == tree.coordinate[i] else 0.0), (k + 1) * bodies
                carrier, body, columns = work[first + tree.parent[i]], work[first + i + 1], Y[k, i]
                for s in samples:
                    turn, before = (joint[0, s], joint[1, s]), (vector(carrier, 0, s), vector(carrier, 3, s))
                    J = link.link_velocity(row, slides, turn, joint[2, s], unit, before)
                    put(body, 0, s, J[0])
                    put(body, 3, s, J[1])
                    wea = vector(motion, 0, s), vector(motion, 3, s), vector(motion, 6, s)
                    ten = link.columns(wea, J)
                    for c in range(10):
                        columns[c, s] = ten[c]
