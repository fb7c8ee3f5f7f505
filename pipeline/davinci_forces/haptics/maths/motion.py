"""The motion of the hand against tissue, with modes switched by a law.

The flow of a mode with stiffness k over a time t is, with sigma = b / 2m and w^2 = sigma^2 - k/m,

    exp(A t) = exp(-sigma t) (cosh(w t) I + sinh(w t)/w (A + sigma I)),

with cos and sin for w^2 < 0.  If a law switches within a step, bisection finds the instant.
"""

import cmath
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from davinci_forces.haptics.maths.bimodal import Hand
from davinci_forces.maths.arrays import Array

State = tuple[float, float]  # x [m], dx [m/s]
Law = Callable[[float, float], float]  # function of x and dx: the tissue acts if its value is positive
SWITCH_HALVINGS = 50
SAMPLES_PER_PERIOD = 100  # periods of the faster mode


class Swing(NamedTuple):
    """Position and velocity (N,) of the hand over time."""

    t: Array  # [s]
    x: Array  # [m]
    dx: Array  # [m/s]


def at_contact(x: float, dx: float) -> float:
    """The real switching law: the tissue acts on one side of its surface.  (8.7)"""
    return x


def worst(x: float, dx: float) -> float:
    """The worst switching law: on either side, the tissue acts only while the hand returns."""
    return -x * dx


def simulate_switching(hand: Hand, k_t: float, start: State, duration: float, law: Law = at_contact) -> Swing:
    """Simulate the hand released at `start`, with tissue of k_t [N/m] switched by a law, for a duration [s]."""
    step = 2.0 * math.pi / math.sqrt((hand.k + k_t) / hand.m) / SAMPLES_PER_PERIOD
    t = step * np.arange(math.ceil(duration / step) + 1, dtype=float)
    states = [start]
    for _ in t[1:]:
        states.append(step_switched(hand, k_t, states[-1], step, law))
    x, dx = np.array(states).T
    return Swing(t, x, dx)


def step_switched(hand: Hand, k_t: float, state: State, step: float, law: Law) -> State:
    """The state after a step in which the law may switch."""
    remaining = step
    while remaining > 0.0:
        ahead = flow(hand, 0.0, state, 1e-9 * step)  # on a switching line, the state just after it selects the mode
        stiffness = k_t if law(*ahead) > 0.0 else 0.0
        after = flow(hand, stiffness, state, remaining)
        if (law(*after) > 0.0) == (stiffness > 0.0):
            return after
        low, high = 0.0, remaining
        for _ in range(SWITCH_HALVINGS):
            middle = 0.5 * (low + high)
            on = (law(*flow(hand, stiffness, state, middle)) > 0.0) == (stiffness > 0.0)
            low, high = (middle, high) if on else (low, middle)
        state, remaining = flow(hand, stiffness, state, high), remaining - high
    return state


def flow(hand: Hand, k_t: float, state: State, t: float) -> State:
    """The state of one mode after a time t [s]."""
    x, dx = state
    sigma, square = 0.5 * hand.b / hand.m, (hand.k + k_t) / hand.m
    w = cmath.sqrt(sigma**2 - square)
    even = cmath.cosh(w * t).real
    odd = (cmath.sinh(w * t) / w).real if w else t
    shrink = math.exp(-sigma * t)
    return shrink * (even * x + odd * (sigma * x + dx)), shrink * (even * dx + odd * (-square * x - sigma * dx))
