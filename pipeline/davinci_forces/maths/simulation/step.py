"""One step of a robot with friction and hard stops: implicit in stiff terms, with exact sticking.

    M(q) ddq + b(q, dq) + v dq + friction + tau_ext = tau                                          (4.40), (A.16)

The step is the midpoint rule, implicit in friction, with the bias at the predicted middle of the step.  This is Moreau
and Jean's scheme for systems with dry friction, of second order where nothing sticks.  Bristles are evaluated at the
end of the step so that they may be stiff, and are of first order (`bristle`).  The velocity at its end minimises

    dq^T A dq / 2 - r^T dq + h sum_i g_i |dq_i|

which is strictly convex, so a joint that friction holds has a velocity of exactly zero.  Jean, Computer Methods in
Applied Mechanics and Engineering 177 (1999) 235-257.

Friction is viscous, Coulomb that differs by direction, Stribeck's rise near rest, and presliding:

    f = g(dq) sign(dq) + v dq,        g(dq) = c + (s - c) exp(-(dq / w)^2)

with c the Coulomb and s the static level of the direction of motion, and w the Stribeck velocity.  A joint with
bristles does not stick: it deflects elastically before it slides (LuGre), which makes friction lag.
Section 6.7; Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425.
"""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_function

MAX_SWEEPS = 100
SWEEP_TOLERANCE = 1e-13  # relative change of a sweep


class Friction(NamedTuple):
    """The friction of n joints; every array is (n,), in the joints' units."""

    viscous: Array  # v
    coulomb_up: Array  # c for dq > 0
    coulomb_down: Array  # c for dq < 0, positive as well
    static_up: Array  # s for dq > 0
    static_down: Array  # s for dq < 0
    stribeck_velocity: Array  # w
    bristle_stiffness: Array  # sigma_0; 0 for none: the joint sticks at rest
    bristle_damping: Array  # sigma_1


@compile_function
def level(friction: Friction, i: int, v: float) -> float:
    """Friction, without its viscous part, of joint i when it slides at v, or starts to move in that direction."""
    up = v >= 0.0
    c = friction.coulomb_up[i] if up else friction.coulomb_down[i]
    s = friction.static_up[i] if up else friction.static_down[i]
    return float(c + (s - c) * np.exp(-((v / friction.stribeck_velocity[i]) ** 2)))


@compile_function
def bristle(friction: Friction, i: int, v: float, z: float, h: float) -> tuple[float, float, float]:
    """The bristles' effort at the end of a step of h [s], constant + slope dq, and the decay of their deflection.

        dz/dt = dq - sigma_0 |dq| z / g,    f = sigma_0 z + sigma_1 dz/dt

    dq and z are implicit, at the end of the step, and |dq| is from its start, which is stable for any stiffness.  The
    deflection at the end is (z + h dq) / decay.
    """
    stiffness, damping = friction.bristle_stiffness[i], friction.bristle_damping[i]
    decay = 1.0 + h * stiffness * abs(v) / level(friction, i, v)
    constant = (stiffness + damping / h) * z / decay - damping * z / h
    slope = (stiffness * h + damping) / decay
    return constant, slope, decay


class State(NamedTuple):
    """The mechanical state of n joints, changed in place by a step."""

    q: Array
    dq: Array
    z: Array  # deflection of the bristles
    before: Array  # velocity a step ago


def at_rest(q: Array) -> State:
    """Standing still at q (n,), with relaxed bristles."""
    return State(q.astype(np.float64), np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q)))


@compile_function
def middle(state: Any, h: float, q: Any, dq: Any) -> None:
    """Fill the predicted position and velocity (n,) in the middle of the coming step."""
    for i in range(len(q)):
        q[i] = state.q[i] + h / 2 * state.dq[i]
        dq[i] = state.dq[i] + (state.dq[i] - state.before[i]) / 2


@compile_function
def step(
    M: Any, b: Any, tau: Any, friction: Friction, lower: Any, upper: Any, state: State, moving: Any, h: float
) -> None:
    """Advance the state by h [s] under constant efforts.

    `M` (n, n) and `b` (n,) are inertia and bias at the middle of the step, `tau` (n,) is the effort less the external
    one.  Joints that are not `moving` (n,) stay at rest.  A joint that would pass `lower` or `upper` is set to it at
    zero velocity, as by Simulink's second-order integrator (section 4.5).
    """
    q, dq, z, before = state
    n = len(q)
    A, r, new = np.empty((n, n)), np.empty(n), np.empty(n)
    up, down, decay, free = np.zeros(n), np.zeros(n), np.ones(n), np.empty(n, np.bool_)
    for i in range(n):
        r[i], new[i], free[i] = h * (tau[i] - b[i]), dq[i], moving[i]
        for j in range(n):
            A[i, j] = M[i, j]
            r[i] += M[i, j] * dq[j]
    _rub(friction, dq, z, h, A, r, up, down, decay)
    side = np.zeros(n)
    for _ in range(n + 1):  # each turn may stop one joint more
        _velocity(A, r, up, down, free, new)
        hit = False
        for i in range(n):
            end = q[i] + h / 2 * (dq[i] + new[i])
            if free[i] and (end > upper[i] or end < lower[i]):
                side[i], free[i], hit = 1.0 if end > upper[i] else -1.0, False, True
        if not hit:
            break
    for i in range(n):
        if side[i] != 0:
            q[i] = upper[i] if side[i] > 0 else lower[i]
        elif moving[i]:
            q[i] += h / 2 * (dq[i] + new[i])
        z[i] = (z[i] + h * new[i]) / decay[i]
        before[i], dq[i] = dq[i], new[i]


@compile_function
def _rub(friction: Any, dq: Any, z: Any, h: float, A: Any, r: Any, up: Any, down: Any, decay: Any) -> None:
    """Add smooth friction to A and r, and fill the impulses up and down that sticking friction can hold."""
    for i in range(len(dq)):
        A[i, i] += h / 2 * friction.viscous[i]
        r[i] -= h / 2 * friction.viscous[i] * dq[i]
        if friction.bristle_stiffness[i] > 0:
            constant, slope, decay[i] = bristle(friction, i, dq[i], z[i], h)
            A[i, i] += h * slope
            r[i] -= h * constant
        else:
            up[i] = h * level(friction, i, max(dq[i], 0.0))
            down[i] = h * level(friction, i, min(dq[i], -1e-300))


@compile_function
def _velocity(A: Any, r: Any, up: Any, down: Any, free: Any, v: Any) -> None:
    """Minimise v^T A v / 2 - r^T v + sum_i (up_i max(v_i, 0) + down_i max(-v_i, 0)), one joint at a time, from v."""
    n = len(r)
    for i in range(n):
        if not free[i]:
            v[i] = 0.0
    for _ in range(MAX_SWEEPS):
        change, size = 0.0, 0.0
        for i in range(n):
            if free[i]:
                s = r[i] + A[i, i] * v[i]
                for j in range(n):
                    s -= A[i, j] * v[j]
                new = (max(s - up[i], 0.0) + min(s + down[i], 0.0)) / A[i, i]
                change, size = max(change, abs(new - v[i])), max(size, abs(new))
                v[i] = new
        if change <= SWEEP_TOLERANCE * size:
            break
