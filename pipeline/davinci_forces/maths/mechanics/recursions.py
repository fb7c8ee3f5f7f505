"""The dynamics of a tree of links, from that of one: outwards from the base with motions, inwards with wrenches.

Recursive Newton-Euler and composite rigid bodies (Featherstone 2008, chapters 5 and 6), and the regressor.  Where a
coordinate moves several links, it collects the effort of all of them.

The functions run as they are on lists of arrays of samples or of floats, and compiled on floats or vectors of samples
(`kernels`).  `q`, `dq`, `ddq` and `turns`, (cos q, sin q), hold one number a coordinate, and results are put into
lists that the caller gives.  `work` is for what they keep of every body in between, the base first: three vectors each.
"""

from collections.abc import Sequence
from typing import Any

from davinci_forces.maths.mechanics import link
from davinci_forces.maths.mechanics.link import Number, Vector, plus
from davinci_forces.maths.mechanics.tree import Tree

Numbers = Sequence[Number]
Turns = Sequence[tuple[Number, Number]]
Work = list[tuple[Vector, Vector, Vector]]


def work_space(tree: Tree, zero: Number, each: int = 2) -> Work:
    """Space for so many things of each body; `zero` is of the kind of number that it is for."""
    none = zero, zero, zero
    return [(none, none, none)] * (each * (len(tree.parent) + 1))


def inverse_dynamics(
    tree: Tree, gravity: float, turns: Turns, q: Numbers, dq: Numbers, ddq: Numbers, work: Work, tau: Any
) -> None:
    """Put the effort of each coordinate into tau; with gravity 0, and ddq 0, it is C dq.  (4.27)

    The work space is for two things of each body: motion and wrench.
    """
    L, zero = len(tree.parent), 0.0 * q[0]
    none = zero, zero, zero
    work[0] = none, none, (zero, zero, zero + gravity)  # standing still feels like accelerating upwards with g
    for k in range(tree.n):
        tau[k] = zero
    for i in range(L):
        k, row = tree.coordinate[i], tree.rows[i]
        motion = link.moved(row, tree.slides[i], turns[k], q[k], dq[k], ddq[k], work[tree.parent[i]])
        f, n = link.wrench_of(row, motion)
        work[i + 1], work[L + i + 2] = motion, (f, n, none)
    for i in range(L - 1, -1, -1):
        k, slides, carrier = tree.coordinate[i], tree.slides[i], tree.parent[i]
        f, n, _ = work[L + i + 2]
        tau[k] = tau[k] + link.along(slides, (f, n))
        if carrier > 0:
            f, n = link.carried(tree.rows[i], slides, turns[k], q[k], (f, n))
            its_f, its_n, _ = work[L + 1 + carrier]
            work[L + 1 + carrier] = plus(its_f, f), plus(its_n, n), none


def mass_matrix(tree: Tree, turns: Turns, q: Numbers, work: Work, M: Any) -> None:
    """Put M into a list by rows.  (4.38)

    The work space is for one thing of each body: first moment and inertia of all that it carries.
    """
    zero, n, L = 0.0 * q[0], tree.n, len(tree.parent)
    for k in range(n * n):
        M[k] = zero
    for i in range(L):
        r = tree.rows[i]
        h, upper = (zero + r[13], zero + r[14], zero + r[15]), (zero + r[16], zero + r[17], zero + r[18])
        work[i + 1] = h, upper, (zero + r[19], zero + r[20], zero + r[21])
    for i in range(L - 1, -1, -1):
        k, m, slides, carrier = tree.coordinate[i], tree.carried[i], tree.slides[i], tree.parent[i]
        wrench = link.unit_wrench(slides, m, work[i + 1])
        M[k * n + k] = M[k * n + k] + link.along(slides, wrench)
        if carrier > 0:
            h, upper, lower = link.carried_inertia(tree.rows[i], slides, turns[k], q[k], m, work[i + 1])
            whole = work[carrier]
            work[carrier] = plus(whole[0], h), plus(whole[1], upper), plus(whole[2], lower)
        j = i
        while tree.parent[j] > 0:
            o = tree.coordinate[j]
            wrench = link.carried(tree.rows[j], tree.slides[j], turns[o], q[o], wrench)
            j = tree.parent[j] - 1
            o, effort = tree.coordinate[j], link.along(tree.slides[j], wrench)
            M[k * n + o] = M[k * n + o] + effort
            M[o * n + k] = M[o * n + k] + effort


def regressor(
    tree: Tree, gravity: float, turns: Turns, q: Numbers, dq: Numbers, ddq: Numbers, work: Work, Y: Any
) -> None:
    """Put the ten columns of link i and coordinate k, where it moves the link, into Y[k L + i].  (6.3)

    The work space is for n + 1 things of each body: its motion, and its Jacobian by each coordinate in its own axes.
    """
    n, L, zero = tree.n, len(tree.parent), 0.0 * q[0]
    none = zero, zero, zero
    work[0] = none, none, (zero, zero, zero + gravity)
    for i in range(L):
        own, row, slides = tree.coordinate[i], tree.rows[i], tree.slides[i]
        motion = link.moved(row, slides, turns[own], q[own], dq[own], ddq[own], work[tree.parent[i]])
        work[i + 1] = motion
        for k in range(n):
            if tree.moves[i][k]:
                unit, carrier = (1.0 if k == own else 0.0), (k + 1) * (L + 1) + tree.parent[i]
                w, v, _ = work[carrier]
                w, v = link.moved_velocity(row, slides, turns[own], q[own], unit, (w, v))
                work[(k + 1) * (L + 1) + i + 1] = w, v, none
                Y[k * L + i] = link.columns(motion, (w, v))
