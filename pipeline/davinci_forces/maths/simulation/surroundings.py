"""The surroundings of a simulated robot, on which it exerts efforts and forces (7.8): a mass, tissue; and paths."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_function
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.kernels import place_and_jacobian

UP = np.array([0.0, 0.0, 1.0])


class Surroundings(NamedTuple):
    """External efforts and forces, mass and tissue, for T ticks."""

    efforts: Array  # (T, n) external efforts at the joints
    forces: Array  # (T, 3) external forces at the tip, base frame [N]
    mass: float  # [kg] at the tip; 0 for none
    stiffness: float  # [N/m] of the tissue; 0 for none
    damping: float  # [N s/m] of the tissue in contact
    surface: Array  # a point (3,) of the tissue's surface [m]
    normal: Array  # (3,) outward normal of the tissue, of length 1
    at_tip: bool  # whether forces or tissue act at the tip


def triangle(t: Array, start: float, end: float, peak: float) -> Array:
    """An effort that rises linearly from zero to a peak midway between start and end, and falls again.  Section 7.3"""
    return peak * np.clip(1 - np.abs(2 * t - start - end) / (end - start), 0, None)


def pulse(t: Array, start: float, end: float, peak: float) -> Array:
    """An effort that is constant from start to end, and zero at other times."""
    return peak * ((t >= start) & (t < end)).astype(np.float64)


SHAPES = {"triangle": triangle, "pulse": pulse}


@compile_function
def on_tip(around: Any, tick: int, x: Any, velocity: Any, force: Any) -> None:
    """Fill the force (3,) [N] of the tip at x (3,) [m]: the external force of this tick plus the force on the tissue.

    Tissue is a spring with a damper, which pushes and never pulls.  (8.1)
    """
    depth, sinking = 0.0, 0.0
    for k in range(3):
        force[k] = around.forces[tick, k]
        depth += (around.surface[k] - x[k]) * around.normal[k]
        sinking -= velocity[k] * around.normal[k]
    if around.stiffness > 0 and depth > 0:
        pressure = max(around.stiffness * depth + around.damping * sinking, 0.0)
        for k in range(3):
            force[k] -= pressure * around.normal[k]


@compile_function
def weigh(plant: Any, q: Any, dq: Any, J: Any, drift: Any) -> None:
    """Fill the Jacobian J (3, n) of the tip, and `drift` = dJ/dt dq + g up (3,) [m/s^2].

    The robot exerts m (a + g up) = m (J ddq + drift) on a mass m at the tip.  Section 7.5
    """
    ahead, h = np.empty_like(J), 1e-6
    place_and_jacobian(plant.tree, plant.body, plant.tip, q, J)
    place_and_jacobian(plant.tree, plant.body, plant.tip, q + h * dq, ahead)
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
        """The position at the times t (N,) [s]; constant before the first point and after the last."""
        times, positions = np.array(self.points).T
        if not self.ease:
            return np.asarray(np.interp(t, times, positions))
        index = np.interp(t, times, np.arange(len(times), dtype=float))
        floor = np.floor(index)
        eased = floor + (1 - np.cos(np.pi * (index - floor))) / 2
        return np.asarray(np.interp(eased, np.arange(len(times)), positions))
