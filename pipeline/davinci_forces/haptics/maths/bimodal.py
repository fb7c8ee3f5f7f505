"""The bimodal haptic model: hand and device are one mass with a spring and a damper, and tissue is on one side.

    m ddx = -K_H x - b dx - K_T x  in contact, x >= 0;  without the last term away from it.  (8.2)-(8.7)

The thesis requires one quadratic function V = x' P x that decreases in both modes.  The model is then stable under
arbitrary switching between them.  The real system switches only at x = 0, and has the energy

    V = m dx^2/2 + K_H x^2/2 + K_T max(x, 0)^2/2,  dV/dt = -b dx^2,

so that it is stable without delay for every K_T >= 0.

Under arbitrary switching, K_T is at its limit if the trajectory of the worst switching law is closed.  The two modes
differ only in the restoring force K_T x.  The worst law omits this force while the hand moves away, and applies it
while the hand returns.  The law therefore switches on both axes of the phase plane, symmetrically.  With omega^2 = K/m
and damping ratio zeta, a mode that starts at speed v reaches the displacement X, and returns from X with speed v':

    X  = v/omega   exp(-g(zeta)),        g = zeta/s  arccos(zeta)
    v' = X omega   exp(-h(zeta)),        h = zeta/s  (pi - arccos(zeta)),     s = sqrt(1 - zeta^2)

Half a turn of the worst law multiplies the speed by omega_1/omega_2 exp(-g(zeta_2) - h(zeta_1)).  At the limit of K_T
this factor is 1.  Below the limit the motion decays under every switching law; above it the motion grows under the
worst law.  This is exact for planar systems.

The flow of a mode with stiffness k over a time t is, with sigma = b / 2m and w^2 = sigma^2 - k/m,

    exp(A t) = exp(-sigma t) (cosh(w t) I + sinh(w t)/w (A + sigma I)),

with cos and sin for w^2 < 0.  If a law switches within a step, bisection finds the instant.
"""

import cmath
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

THESIS_TISSUE = 457.24  # [N/m], section 8.2
SERIES_RANGE = 1e-6  # distance of a damping ratio from 1 within which the series is used
MIN_HAND_STIFFNESS, MAX_HAND_STIFFNESS = 1.0, 1e5  # [N/m] range of K_H
State = tuple[float, float]  # x [m], dx [m/s]
Law = Callable[[float, float], float]  # function of x and dx: the tissue acts if its value is positive
SWITCH_HALVINGS = 50
SAMPLES_PER_PERIOD = 100  # periods of the faster mode


class Hand(NamedTuple):
    """The human arm that holds a haptic device; all values are positive."""

    m: float  # [kg]
    b: float  # [N s/m]
    k: float  # K_H [N/m]

    @property
    def frequency(self) -> float:
        """Natural frequency without tissue [rad/s]."""
        return float(np.sqrt(self.k / self.m))

    def damping_ratio(self, k_t: float = 0.0) -> float:
        """The damping ratio with a tissue of stiffness k_t [N/m]."""
        return self.b / (2.0 * float(np.sqrt(self.m * (self.k + k_t))))


THESIS_HAND = Hand(1.0, 1.0, 100.0)  # m and b of section 8.3, which states no K_H; 100 N/m is a relaxed arm


def mode(hand: Hand, k_t: float) -> Array:
    """A (2, 2) of dx/dt = A x with tissue of stiffness k_t [N/m]: A_1, or A_2 for k_t = 0.  (8.4), (8.6)"""
    return np.array([[0.0, 1.0], [-(hand.k + k_t) / hand.m, -hand.b / hand.m]])


def cqlf_limit(hand: Hand) -> float:
    """The K_T [N/m] below which a common quadratic Lyapunov function exists; none exists above it.

    K_T < b^2/m + 2 b sqrt(K_H/m).  For two modes that differ by a matrix of rank one, a common function exists if the
    product A_1 A_2 has no negative real eigenvalue.
    """
    return float(hand.b**2 / hand.m + 2.0 * hand.b * hand.frequency)


def energy(hand: Hand, k_t: float, x: Array, dx: Array) -> Array:
    """V [J] of the model that switches at x = 0; V decreases during motion; x [m], dx [m/s]."""
    return 0.5 * (hand.m * dx**2 + hand.k * x**2 + k_t * np.maximum(x, 0.0) ** 2)


def switching_limit(hand: Hand) -> float:
    """The K_T [N/m] at which the motion neither grows nor decays under the worst switching law."""
    from scipy.optimize import brentq  # here, so that reading a hand from a file loads no solver

    high = cqlf_limit(hand)  # below this K_T the motion grows under no law
    while log_growth(hand, high) < 0.0:
        high *= 2.0
    return float(brentq(lambda k_t: log_growth(hand, k_t), 0.5 * high, high, xtol=1e-12 * high, rtol=1e-12))


def log_growth(hand: Hand, k_t: float) -> float:
    """The log of the factor of the speed over half a turn of the worst law; -inf if the motion never turns."""
    soft, stiff = hand.damping_ratio(), hand.damping_ratio(k_t)
    if stiff >= 1.0:
        return -math.inf
    return 0.5 * math.log1p(k_t / hand.k) - log_loss_away(soft) - log_loss_back(stiff)


def log_loss_away(zeta: float) -> float:
    """g: the logarithmic loss of speed to damping, on the way from the axis to the turning point."""
    if abs(1.0 - zeta) < SERIES_RANGE:
        return 1.0 + (zeta - 1.0) * 2.0 / 3.0
    return abs(zeta / cmath.sqrt(1.0 - zeta**2) * cmath.acos(zeta))  # above 1, root and angle are imaginary


def log_loss_back(zeta: float) -> float:
    """h: the logarithmic loss of speed on the way back to the axis; zeta < 1, or the axis is never reached."""
    return zeta / math.sqrt(1.0 - zeta**2) * (math.pi - math.acos(zeta))


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
