"""The bimodal haptic model: hand and haptic device as one mass on a spring and a damper, and tissue on one side only.

    m ddx = -K_H x - b dx - K_T x  in contact, x >= 0;  without the last term away from it.  (8.2)-(8.7)

What the thesis asks of it is one quadratic function V = x' P x that falls in both modes.  That says that no switching
between them, however fast and wherever, makes it unstable.  The real one switches where x = 0 only, and there

    V = m dx^2/2 + K_H x^2/2 + K_T max(x, 0)^2/2,  dV/dt = -b dx^2,

so that without delay it is stable for every K_T >= 0.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array


class Hand(NamedTuple):
    """The human arm that holds a haptic device; all of it positive."""

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


THESIS = Hand(1.0, 1.0, 100.0)  # m and b of section 8.3; it states no K_H, and 100 N/m is an arm held loosely
THESIS_TISSUE = 457.24  # [N/m], section 8.2


def mode(hand: Hand, k_t: float) -> Array:
    """The matrix (2, 2) of dx/dt = A x with a tissue of stiffness k_t [N/m]: A_1, and at 0 A_2.  (8.4), (8.6)"""
    return np.array([[0.0, 1.0], [-(hand.k + k_t) / hand.m, -hand.b / hand.m]])


def cqlf_limit(hand: Hand) -> float:
    """The K_T [N/m] below which a common quadratic Lyapunov function exists, and not from there on.

    K_T < b^2/m + 2 b sqrt(K_H/m): for two modes that differ by a matrix of rank one, such a function exists where the
    product A_1 A_2 has no negative real eigenvalue.
    """
    return float(hand.b**2 / hand.m + 2.0 * hand.b * hand.frequency)


def energy(hand: Hand, k_t: float, x: Array, dx: Array) -> Array:
    """V [J] of the model as it really switches, which falls wherever it moves; x [m], dx [m/s]."""
    return 0.5 * (hand.m * dx**2 + hand.k * x**2 + k_t * np.maximum(x, 0.0) ** 2)
