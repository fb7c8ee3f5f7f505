"""The surroundings of a simulated robot: efforts at its joints, forces on its tip, a mass, tissue; and its path.

Efforts and forces are those that the robot exerts on its surroundings (7.8).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_function
from davinci_forces.maths.constants import GRAVITY

UP = np.array([0.0, 0.0, 1.0])


class Surroundings(NamedTuple):
    """External efforts and forces, mass and tissue, for T ticks."""

    efforts: Array  # (T, n) at the joints
    forces: Array  # (T, 3) of the tip, base frame [N]
    mass: float  # [kg] at the tip; 0 for none
    stiffness: float  # [N/m] of the tissue; 0 for none
    damping: float  # [N s/m] of the tissue while it is pressed
    surface: Array  # a point (3,) of the tissue's surface [m]
    normal: Array  # (3,) out of the tissue, of length 1
    at_tip: bool  # whether anything but efforts and the mass acts


def triangle(t: Array, start: float, end: float, peak: float) -> Array:
    """An effort that rises from zero to its peak midway between start and end, and falls again.  Section 7.3"""
    return peak * np.clip(1 - np.abs(2 * t - start - end) / (end - start), 0, None)


def pulse(t: Array, start: float, end: float, peak: float) -> Array:
    """An effort that is constant from start to end, and zero elsewhere."""
    return peak * ((t >= start) & (t < end)).astype(np.float64)


SHAPES = {"triangle": triangle, "pulse": pulse}


@compile_function
def on_tip(around: Any, tick: int, x: Any, velocity: Any, force: Any) -> None:
    """Fill the force (3,) [N] of the tip at x (3,) [m] on its surroundings: that of this tick, and that of tissue.

    Tissue is a spring with a damper, which pushes and never pulls.  (8.1)
    """
    depth, sinking = 0.0, 0.0
    for k in range(3):
        force[k] = around.forces[tick, k]
        depth += (around.surface[k] - x[k]) * around.normal[k]
        sinking -= velocity[k] * around.normal[k]
    if around.stiffness > 0 and depth > 0:
        pressed = max(around.stiffness * depth + around.damping * sinking, 0.0)
        for k in range(3):
            force[k] -= pressed * around.normal[k]


@compile_function
def weigh(tip: Any, data: Any, q: Any, dq: Any, J: Any, drift: Any) -> None:
    """Fill the Jacobian (3, n) of the tip, and dJ/dt dq + g up (3,) [m/s^2]: the load of a mass there, less J ddq.

    The robot exerts m (a + g up) on the mass, with a = J ddq + dJ/dt dq.  Section 7.5
    """
    ahead, h = np.empty_like(J), 1e-6
    tip(data, q, J)
    tip(data, q + h * dq, ahead)
    for k in range(3):
        drift[k] = GRAVITY if k == 2 else 0.0
        for i in range(len(q)):
            drift[k] += (ahead[k, i] - J[k, i]) * dq[i] / h


@dataclass(frozen=True)
class Path:
    """Positions at given times, with constant speed or cosine ramps between them."""

    points: tuple[tuple[float, float], ...]  # time [s], position
    ease: bool

    def position(self, t: Array) -> Array:
        """The position at the times t (N,) [s]; the first and the last position hold before and after."""
        times, positions = np.array(self.points).T
        if not self.ease:
            return np.asarray(np.interp(t, times, positions))
        part = np.interp(t, times, np.arange(len(times), dtype=float))
        whole = np.floor(part)
        eased = whole + (1 - np.cos(np.pi * (part - whole))) / 2
        return np.asarray(np.interp(eased, np.arange(len(times)), positions))
