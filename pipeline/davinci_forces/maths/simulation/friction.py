"""Friction of a joint: viscous, Coulomb that differs by direction, Stribeck's rise near rest, and presliding.

    f = g(dq) sign(dq) + v dq,        g(dq) = c + (s - c) exp(-(dq / w)^2)

with c the Coulomb and s the static level of the direction moved in, and w the Stribeck velocity.  Where a joint has
bristles it does not stick: it gives way elastically before it slides (LuGre), which is what makes friction lag.
Section 6.7; Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compiled


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


@compiled
def level(friction: Friction, i: int, v: float) -> float:
    """What friction without its viscous part comes to when joint i slides at v, or would start to move that way."""
    up = v >= 0.0
    c = friction.coulomb_up[i] if up else friction.coulomb_down[i]
    s = friction.static_up[i] if up else friction.static_down[i]
    return float(c + (s - c) * np.exp(-((v / friction.stribeck_velocity[i]) ** 2)))


@compiled
def bristle(friction: Friction, i: int, v: float, z: float, h: float) -> tuple[float, float, float]:
    """The bristles' effort at the end of a step of h [s], constant + slope dq, and the decay of their deflection.

    dz/dt = dq - sigma_0 |dq| z / g, f = sigma_0 z + sigma_1 dz/dt, taken implicitly in dq and z at the end of the
    step and with |dq| from its start, so that it is stable however stiff the bristles are.  The deflection at the end
    is (z + h dq) / decay.
    """
    stiffness, damping = friction.bristle_stiffness[i], friction.bristle_damping[i]
    decay = 1.0 + h * stiffness * abs(v) / level(friction, i, v)
    constant = (stiffness + damping / h) * z / decay - damping * z / h
    slope = (stiffness * h + damping) / decay
    return constant, slope, decay


def steady(friction: Friction, i: int, v: Array) -> Array:
    """The effort (K,) that keeps joint i sliding at constant velocities v (K,) that are not zero.  Fig 6.21"""
    return np.array([level(friction, i, x) * np.sign(x) + friction.viscous[i] * x for x in v.tolist()])
