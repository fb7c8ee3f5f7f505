"""How the hand moves against tissue: switched by a law, each mode exactly, or with a force that comes late and is held.

The flow of a mode with stiffness k over a time t is, with sigma = b / 2m and w^2 = sigma^2 - k/m,

    exp(A t) = exp(-sigma t) (cosh(w t) I + sinh(w t)/w (A + sigma I)),

with cos and sin where w^2 < 0; where a law switches within a step, the instant is found by halving.
"""

import cmath
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from davinci_forces.haptics.maths.bimodal import Hand
from davinci_forces.haptics.maths.delay import discretised
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import cached

State = tuple[float, float]  # x [m], dx [m/s]
Law = Callable[[float, float], float]  # of x and dx: the tissue acts where it is positive
HALVINGS = 50
EACH_PERIOD = 100  # samples of the quicker mode's period
SWINGS = 60  # of the free hand, after which a motion has shown whether it grows
FINE = 100  # samples of a delay that stands for a continuous one
LIMIT_HALVINGS = 14
BRACKET = (0.25, 64.0)  # times the limit of the hand in contact: where the limit of one that leaves it is looked for


class Swing(NamedTuple):
    """Position and velocity (N,) of the hand over time."""

    t: Array  # [s]
    x: Array  # [m]
    dx: Array  # [m/s]


def at_contact(x: float, dx: float) -> float:
    """The switching there is: the tissue acts on one side of its surface.  (8.7)"""
    return x


def worst(x: float, dx: float) -> float:
    """The worst switching: the tissue acts on the way back only, on either side."""
    return -x * dx


def switched(hand: Hand, k_t: float, start: State, duration: float, law: Law = at_contact) -> Swing:
    """The hand let go at `start`, with a tissue of k_t [N/m] that acts by a law, for a duration [s]."""
    step = 2.0 * math.pi / math.sqrt((hand.k + k_t) / hand.m) / EACH_PERIOD
    t = step * np.arange(math.ceil(duration / step) + 1, dtype=float)
    states = [start]
    for _ in t[1:]:
        states.append(stepped(hand, k_t, states[-1], step, law))
    x, dx = np.array(states).T
    return Swing(t, x, dx)


def stepped(hand: Hand, k_t: float, state: State, step: float, law: Law) -> State:
    """The state a step later, in which the law may switch."""
    left = step
    while left > 0.0:
        ahead = flow(hand, 0.0, state, 1e-9 * step)  # on a line where it switches, what comes next decides
        stiffness = k_t if law(*ahead) > 0.0 else 0.0
        after = flow(hand, stiffness, state, left)
        if (law(*after) > 0.0) == (stiffness > 0.0):
            return after
        low, high = 0.0, left
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            on = (law(*flow(hand, stiffness, state, middle)) > 0.0) == (stiffness > 0.0)
            low, high = (middle, high) if on else (low, middle)
        state, left = flow(hand, stiffness, state, high), left - high
    return state


def flow(hand: Hand, k_t: float, state: State, t: float) -> State:
    """The state of one mode a time t [s] later."""
    x, dx = state
    sigma, square = 0.5 * hand.b / hand.m, (hand.k + k_t) / hand.m
    w = cmath.sqrt(sigma**2 - square)
    even = cmath.cosh(w * t).real
    odd = (cmath.sinh(w * t) / w).real if w else t
    shrink = math.exp(-sigma * t)
    return shrink * (even * x + odd * (sigma * x + dx)), shrink * (even * dx + odd * (-square * x - sigma * dx))


def late(hand: Hand, k_t: float, delay: float, rate: float, push: float, duration: float) -> Swing:
    """The hand with a force that is held at `rate` [Hz] and `delay` [s] late, of tissue on one side only.

    Where `push` > 0 [N], the hand presses into the tissue, rests, and is disturbed by a hundredth of its depth, so that
    it stays in contact; where it is 0, the hand is let go 1 cm away from the tissue.
    """
    Phi, early, after, samples = discretised(hand, delay, rate)
    x_0 = push / (hand.k + k_t) if push else 0.0
    ticks = math.ceil(duration * rate)
    x, dx = np.empty(ticks), np.empty(ticks)
    held = np.full(samples + 2, -k_t * x_0)
    x[0], dx[0] = (1.01 * x_0 if push else -0.01), 0.0
    _late(Phi, early, after, (early + after) * push, k_t, held, x, dx)
    return Swing(np.arange(ticks) / rate, x - x_0, dx)


@cached
def _late(Phi: Array, early: Array, after: Array, pushed: Array, k_t: float, held: Array, x: Array, dx: Array) -> None:
    """Fill x and dx (N,) from their first; `held` goes round, and holds the force of each of the ticks before."""
    n = len(held)
    for k in range(len(x) - 1):
        held[k % n] = -k_t * max(x[k], 0.0)
        new, old = held[(k + 2) % n], held[(k + 1) % n]
        x[k + 1] = Phi[0, 0] * x[k] + Phi[0, 1] * dx[k] + early[0] * new + after[0] * old + pushed[0]
        dx[k + 1] = Phi[1, 0] * x[k] + Phi[1, 1] * dx[k] + early[1] * new + after[1] * old + pushed[1]


def grows(hand: Hand, motion: Swing) -> bool:
    """Whether a motion is larger at its end than before: its last quarter against the one before."""
    size = np.hypot(motion.x, motion.dx / hand.frequency)
    quarter = len(size) // 4
    last, before = float(size[-quarter:].max()), float(size[-2 * quarter : -quarter].max())
    return not last < before


def leaving_limit(hand: Hand, delay: float, contact_limit: float) -> float:
    """The K_T [N/m] from which a hand that nothing pushes bounces ever higher off the tissue, by simulation.

    Its contact lasts part of each turn only; the limit of the hand in contact begins the search, and NaN says that
    64 times that is not enough, as for a hand so damped that it hardly comes back.
    """
    rate = FINE / delay
    exact = delay - 0.5 / rate  # holding makes it half a sample later
    slow = 2.0 * math.pi / hand.frequency * SWINGS
    low, high = (share * contact_limit for share in BRACKET)
    if not grows(hand, late(hand, high, exact, rate, 0.0, slow)):
        return math.nan
    for _ in range(LIMIT_HALVINGS):
        middle = math.sqrt(low * high)
        growing = grows(hand, late(hand, middle, exact, rate, 0.0, slow))
        low, high = (low, middle) if growing else (middle, high)
    return math.sqrt(low * high)
