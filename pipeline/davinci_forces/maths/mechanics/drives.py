"""What the motors and gears add to the dynamics of the links: reflected inertia and friction.

    eta tau_m = (eta^2 J_m + M) ddq + V + G + F + tau_ext,    F = v dq + c sign(dq)          (4.26), (4.28), (A.16)

Everything is a coordinate's own: drives do not couple.  Shapes: (n,) for a property, (..., n) for a motion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from davinci_forces.maths.arrays import Array


@dataclass(frozen=True, eq=False)
class Drives:
    """One drive a coordinate (n,): everything at the joint's side except the motor's own inertia.

    `viscous` and `coulomb` are those of joint and motor together, as the joint feels them.  (A.11)
    """

    gear_ratio: Array  # eta [-], or [rad/m] for a prismatic joint
    motor_inertia: Array  # J_m [kg m^2]
    viscous: Array  # v [N m s/rad], or [N s/m]
    coulomb: Array  # c [N m], or [N]

    def reduced(self, n: int) -> "Drives":
        """Those of the first n coordinates."""
        return Drives(self.gear_ratio[:n], self.motor_inertia[:n], self.viscous[:n], self.coulomb[:n])

    @property
    def inertia(self) -> Array:
        """The motors' inertia at the joints, eta^2 J_m (n,).  (4.28), which (4.29) neglects and (6.7)-(6.13) keep"""
        return np.asarray(self.gear_ratio**2 * self.motor_inertia)

    def friction(self, dq: ArrayLike) -> Array:
        """F (..., n) at the velocities dq (..., n).  (4.26)"""
        dq = np.asarray(dq, float)
        return np.asarray(self.viscous * dq + self.coulomb * np.sign(dq))
