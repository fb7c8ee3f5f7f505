"""The motion of the hand against tissue: with modes switched by a law, or with a delayed and held force.

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
from davinci_forces.haptics.maths.delay import delayed_hold
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_and_store

State = tuple[float, float]  # x [m], dx [m/s]
Law = Callable[[float, float], float]  # function of x and dx: the tissue acts if its value is positive
SWITCH_HALVINGS = 50
SAMPLES_PER_PERIOD = 100  # periods of the faster mode
GROWTH_PERIODS = 60  # periods of the free hand in which growth becomes visible
SAMPLES_PER_DELAY = 100  # enough to approximate a continuous delay
LIMIT_HALVINGS = 14
BRACKET = (0.25, 64.0)  # search range for `leaving_limit`, as factors of the limit in contact


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


def simulate_delayed(hand: Hand, k_t: float, delay: float, rate: float, push: float, duration: float) -> Swing:
    """Simulate the hand against tissue on one side, with a force held at `rate` [Hz] and delayed by `delay` [s].

    If `push` > 0 [N], the hand starts at rest, pressed into the tissue, and disturbed by 1 % of its depth; it stays in
    contact.  If `push` is 0, the hand is released 1 cm away from the tissue.
    """
    Phi, early, after, samples = delayed_hold(hand, delay, rate)
    x_0 = push / (hand.k + k_t) if push else 0.0
    ticks = math.ceil(duration * rate)
    x, dx = np.empty(ticks), np.empty(ticks)
    forces = np.full(samples + 2, -k_t * x_0)
    x[0], dx[0] = (1.01 * x_0 if push else -0.01), 0.0
    _fill(Phi, early, after, (early + after) * push, k_t, forces, x, dx)
    return Swing(np.arange(ticks) / rate, x - x_0, dx)


@compile_and_store
def _fill(Phi: Array, early: Array, after: Array, bias: Array, k_t: float, forces: Array, x: Array, dx: Array) -> None:
    """Fill x and dx (N,) from their first values; `forces` is a ring buffer of the last forces."""
    n = len(forces)
    for k in range(len(x) - 1):
        forces[k % n] = -k_t * max(x[k], 0.0)
        new, old = forces[(k + 2) % n], forces[(k + 1) % n]
        x[k + 1] = Phi[0, 0] * x[k] + Phi[0, 1] * dx[k] + early[0] * new + after[0] * old + bias[0]
        dx[k + 1] = Phi[1, 0] * x[k] + Phi[1, 1] * dx[k] + early[1] * new + after[1] * old + bias[1]


def grows(hand: Hand, motion: Swing) -> bool:
    """Test whether a motion is at least as large in its last quarter as in the quarter before."""
    size = np.hypot(motion.x, motion.dx / hand.frequency)
    quarter = len(size) // 4
    last, before = float(size[-quarter:].max()), float(size[-2 * quarter : -quarter].max())
    return not last < before


def leaving_limit(hand: Hand, delay: float, contact_limit: float) -> float:
    """The K_T [N/m] above which a hand without push bounces off the tissue with growing amplitude, by simulation.

    Contact lasts for part of each period.  The search starts from the limit of the hand in contact.  NaN means that the
    motion does not grow at 64 times that limit, for example because a strongly damped hand hardly returns.
    """
    rate = SAMPLES_PER_DELAY / delay
    exact = delay - 0.5 / rate  # the hold adds half a sample
    duration = 2.0 * math.pi / hand.frequency * GROWTH_PERIODS
    low, high = (share * contact_limit for share in BRACKET)
    if not grows(hand, simulate_delayed(hand, high, exact, rate, 0.0, duration)):
        return math.nan
    for _ in range(LIMIT_HALVINGS):
        middle = math.sqrt(low * high)
        growing = grows(hand, simulate_delayed(hand, middle, exact, rate, 0.0, duration))
        low, high = (low, middle) if growing else (middle, high)
    return math.sqrt(low * high)
