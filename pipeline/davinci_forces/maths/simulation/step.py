"""One time step of a robot with friction and end stops: implicit in stiff terms, with exact sticking.

    M(q) ddq + b(q, dq) + v dq + friction + tau_ext = tau                                          (4.40), (A.16)

The step is the midpoint rule, implicit in friction, with the bias at the predicted middle of the step.  This is the
scheme of Moreau and Jean for dry friction; its order is two if no joint sticks.  Bristles are evaluated at the end of
the step, so that they may be stiff, and have order one (`bristle`).  The velocity at the end of the step minimises

    dq^T A dq / 2 - r^T dq + h sum_i g_i |dq_i|

which is strictly convex, so that a sticking joint has a velocity of exactly zero.  Jean, Computer Methods in
Applied Mechanics and Engineering 177 (1999) 235-257.

Friction has viscous and Coulomb parts, a Stribeck peak near rest, and presliding; levels depend on the direction:

    f = g(dq) sign(dq) + v dq,        g(dq) = c + (s - c) exp(-(dq / w)^2)

c and s are the Coulomb and static level in the direction of motion, and w is the Stribeck velocity.  A joint with
bristles does not stick: it deflects elastically before it slides (LuGre), so that friction lags behind the motion.
Section 6.7; Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425.
"""

from math import exp
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_function

MAX_SWEEPS = 100
SWEEP_TOLERANCE = 1e-13  # relative change of the velocities in a sweep, at which the sweeps end


class Friction(NamedTuple):
    """The friction of n joints; every array is (n,), in the joints' units."""

    viscous: Array  # v
    coulomb_up: Array  # c for dq > 0
    coulomb_down: Array  # c for dq < 0, positive as well
    static_up: Array  # s for dq > 0
    static_down: Array  # s for dq < 0
    stribeck_velocity: Array  # w
    bristle_stiffness: Array  # sigma_0; 0 for no bristles: the joint sticks at rest
    bristle_damping: Array  # sigma_1


@compile_function
def level(friction: Friction, i: int, v: float) -> float:
    """The friction level g of joint i at velocity v, without viscous friction; at v = 0, of the positive direction."""
    up = v >= 0.0
    c = friction.coulomb_up[i] if up else friction.coulomb_down[i]
    s = friction.static_up[i] if up else friction.static_down[i]
    ratio = v / friction.stribeck_velocity[i]
    return float(c + (s - c) * exp(-(ratio * ratio)))


@compile_function
def bristle(friction: Friction, i: int, v: float, z: float, h: float) -> tuple[float, float, float]:
    """Constant and slope of the bristles' effort, constant + slope dq, at the end of a step h [s]; and `decay`.

        dz/dt = dq - sigma_0 |dq| z / g,    f = sigma_0 z + sigma_1 dz/dt

    dq and z are those at the end of the step, and |dq| is taken at its start; this is stable for any stiffness.  The
    deflection at the end of the step is (z + h dq) / decay.
    """
    stiffness, damping = friction.bristle_stiffness[i], friction.bristle_damping[i]
    decay = 1.0 + h * stiffness * abs(v) / level(friction, i, v)
    constant = (stiffness + damping / h) * z / decay - damping * z / h
    slope = (stiffness * h + damping) / decay
    return constant, slope, decay


class State(NamedTuple):
    """The mechanical state of n joints, which a step changes in place."""

    q: Array
    dq: Array
    z: Array  # deflection of the bristles
    before: Array  # velocity one step before


def at_rest(q: Array) -> State:
    """The state at rest at q (n,), with relaxed bristles."""
    return State(q.astype(np.float64), np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q)))


@compile_function
def middle(state: Any, h: float, q: Any, dq: Any) -> None:
    """Fill the predicted position and velocity (n,) in the middle of the next step."""
    for i in range(len(q)):
        q[i] = state.q[i] + h / 2 * state.dq[i]
        dq[i] = state.dq[i] + (state.dq[i] - state.before[i]) / 2


@compile_function
def step(M: Any, b: Any, tau: Any, friction: Friction, lower: Any, upper: Any, state: State, h: float) -> None:
    """Advance the state by h [s] under constant efforts.

    `M` (n, n) and `b` (n,) are inertia and bias at the middle of the step; `tau` (n,) is the effort minus the external
    effort.  A joint that would pass `lower` or `upper` is set to this stop with zero velocity, as in Simulink's
    second-order integrator (section 4.5).
    """
    q, dq, z, before = state.q, state.dq, state.z, state.before
    n = len(q)
    A, rows = np.zeros((n, n)), np.zeros((7, n))
    r, new, up, down, decay, free, side = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]
    for i in range(n):
        r[i], new[i], decay[i], free[i] = h * (tau[i] - b[i]), dq[i], 1.0, 1.0
        for j in range(n):
            A[i, j] = M[i, j]
            r[i] += M[i, j] * dq[j]
    _add_friction(friction, dq, z, h, A, r, up, down, decay)
    for _ in range(n + 1):  # each iteration may stop one more joint
        _velocity(A, r, up, down, free, new)
        hit = False
        for i in range(n):
            end = q[i] + h / 2 * (dq[i] + new[i])
            if free[i] and (end > upper[i] or end < lower[i]):
                side[i], free[i], hit = 1.0 if end > upper[i] else -1.0, 0.0, True
        if not hit:
            break
    for i in range(n):
        if side[i] != 0:
            q[i] = upper[i] if side[i] > 0 else lower[i]
        else:
            q[i] += h / 2 * (dq[i] + new[i])
        z[i] = (z[i] + h * new[i]) / decay[i]
        before[i], dq[i] = dq[i], new[i]


@compile_function
def _add_friction(friction: Any, dq: Any, z: Any, h: float, A: Any, r: Any, up: Any, down: Any, decay: Any) -> None:
    """Add viscous and bristle friction to A and r, and fill the impulses up and down of dry friction."""
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
