"""The dynamics of an arm's links for one sample, compiled: what a simulator's step needs.

    arm = rigid_body_kernels.pack(chain, bodies, n)
    M, bias, scratch = np.empty((n, n)), np.empty(n), work(arm)
    mass_and_bias(arm, GRAVITY, q, dq, M, bias, scratch)       # from Python or from compiled code

Shapes: q, dq, bias (n,); M (n, n).  Import this module only where it is used, as with `rigid_body_kernels`.
"""

from math import cos, sin

import numpy as np
from numba import njit

from pipeline.maths.arrays import Array
from pipeline.maths.mechanics.lanes import ONE, PackedArm, forget_older, row
from pipeline.maths.mechanics.link import carried, composite, motion, plus, wrench

WORK = 27  # w, e, a, force, moment; cos, sin, d; h and I of all that the frame carries


def work(arm: PackedArm) -> Array:
    """Scratch space for `mass_and_bias`; what it holds before and after means nothing."""
    return np.empty((len(arm.parent) + 1, WORK))


@njit(inline="always")
def _three(block, i, column):  # type: ignore[no-untyped-def]
    return block[i, column], block[i, column + 1], block[i, column + 2]


@njit(inline="always")
def _put(block, i, column, x):  # type: ignore[no-untyped-def]
    block[i, column], block[i, column + 1], block[i, column + 2] = x


@njit(inline="always")
def _pose(arm, j, q):  # type: ignore[no-untyped-def]
    """cos and sin of a link's theta, and its d."""
    theta = q[arm.turns[j]] if arm.turns[j] < arm.n else 0.0
    ct, st = cos(theta), sin(theta)
    c0, s0 = arm.links[j, 0], arm.links[j, 1]
    d = arm.links[j, 5] + (q[arm.slides[j]] if arm.slides[j] < arm.n else 0.0)
    return c0 * ct - s0 * st, s0 * ct + c0 * st, d


@njit(inline="always")
def _rates(arm, j, dq):  # type: ignore[no-untyped-def]
    """How fast a link turns and slides."""
    turning = dq[arm.turns[j]] if arm.turns[j] < arm.n else 0.0
    return turning, (dq[arm.slides[j]] if arm.slides[j] < arm.n else 0.0)


@njit(cache=True)
def mass_and_bias(arm, gravity, q, dq, M, bias, work):  # type: ignore[no-untyped-def]
    """Write M(q) and C dq + G of one sample.  (4.41)

    The arm and `work` come from `pack` and `work`; gravity [m/s^2].
    """
    n, L = arm.n, len(arm.parent)
    M[:], bias[:], work[:, 9:15], work[:, 18:] = 0.0, 0.0, 0.0, 0.0
    work[0, :9] = 0.0
    work[0, 8] = gravity
    for i in range(L):
        j = np.uint64(i)
        p, o, link = arm.parent[j], j + ONE, row(arm.links, j)
        c, s, d = _pose(arm, j, q)
        dt, dd = _rates(arm, j, dq)
        w, e, a = motion(_three(work, p, 0), _three(work, p, 3), _three(work, p, 6), c, s, d, dt, dd, 0.0, 0.0, link)
        f, m = wrench(w, e, a, link)
        _put(work, o, 0, w)
        _put(work, o, 3, e)
        _put(work, o, 6, a)
        _put(work, o, 9, f)
        _put(work, o, 12, m)
        _put(work, o, 15, (c, s, d))
        work[o, 18:] = arm.links[j, 7:]
    carried_mass = _masses(arm, work)
    for i in range(L):
        j = np.uint64(L - 1 - i)
        p, o, link = arm.parent[j], j + ONE, row(arm.links, j)
        c, s, d = _three(work, o, 15)
        f, t = carried(c, s, d, link, _three(work, o, 9), _three(work, o, 12))
        _put(work, p, 9, plus(_three(work, p, 9), f))
        _put(work, p, 12, plus(_three(work, p, 12), t))
        m = carried_mass[o]
        h, inertia = composite(c, s, d, link, m, _three(work, o, 18), _three(work, o, 21) + _three(work, o, 24))
        _put(work, p, 18, plus(_three(work, p, 18), h))
        _put(work, p, 21, plus(_three(work, p, 21), inertia[:3]))
        _put(work, p, 24, plus(_three(work, p, 24), inertia[3:]))
        if arm.turns[j] < n:
            bias[arm.turns[j]] += t[2]
            _couple(arm, j, arm.turns[j], (-h[1], h[0], 0.0), (inertia[2], inertia[4], inertia[5]), inertia[5], M, work)
        elif arm.slides[j] < n:
            bias[arm.slides[j]] += f[2]
            _couple(arm, j, arm.slides[j], (0.0, 0.0, m), (h[1], -h[0], 0.0), m, M, work)


@njit(inline="always")
def _masses(arm, work):  # type: ignore[no-untyped-def]
    """The mass that each frame carries, in the first column of `work`, whose motions are not needed any more."""
    L = len(arm.parent)
    masses = work[:, 0]
    masses[0] = 0.0
    for i in range(L):
        masses[i + 1] = arm.links[i, 6]
    for i in range(L):
        j = np.uint64(L - 1 - i)
        masses[arm.parent[j]] += masses[j + ONE]
    return masses


@njit(inline="always")
def _couple(arm, j, own, f, t, itself, M, work):  # type: ignore[no-untyped-def]
    """Add to M what one unit of a link's own acceleration, f and t at its carrier, takes of every coordinate."""
    M[own, own] += itself
    frame = arm.parent[j]
    while frame > 0:
        p = frame - ONE
        c, s, d = _three(work, frame, 15)
        f, t = carried(c, s, d, row(arm.links, p), f, t)
        if arm.turns[p] < arm.n:
            M[own, arm.turns[p]] += t[2]
            M[arm.turns[p], own] += t[2]
        elif arm.slides[p] < arm.n:
            M[own, arm.slides[p]] += f[2]
            M[arm.slides[p], own] += f[2]
        frame = arm.parent[p]


forget_older(mass_and_bias)
