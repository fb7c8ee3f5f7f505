"""What moves an arm, as numbers: motors, the controllers before them, and the device that a hand holds.

No loop runs here, so that whoever reads these from a file need not load a compiler.
"""

from typing import NamedTuple

from davinci_forces.maths.arrays import Array


class Motors(NamedTuple):
    """The motors of n joints; every array is (n,).  Table 6.3, (A.5)"""

    gear_ratio: Array  # eta [-] or [rad/m]
    torque_constant: Array  # K_m [N m/A], which is also K_b [V s/rad]
    resistance: Array  # R [ohm]
    inductance: Array  # L [H]
    current_limit: Array  # [A]
    voltage_limit: Array  # [V]
    encoder_step: Array  # [rad] of the motor; 0 for an encoder without steps


class Cascade(NamedTuple):
    """Position, velocity and current PI loops of n joints, in the motors' units.  Fig 2.5

    The position loop runs at the controller's rate, the two others in the motor driver.
    """

    position_p: Array  # [1/s]
    position_i: Array  # [1/s^2]
    velocity_p: Array  # [A s/rad]
    velocity_i: Array  # [A/rad]
    current_p: Array  # [V/A]
    current_i: Array  # [V/(A s)]
    velocity_filter: Array  # [s] time constant of the driver's velocity, the low-passed difference of angles


class Loops(NamedTuple):
    """What the cascade remembers of n joints, in the motors' units; every array is (n,)."""

    position_i: Array  # the integrals
    velocity_i: Array
    current_i: Array
    last: Array  # velocity asked for in the last turn of the controller, and in this one
    wanted: Array
    angle: Array  # that the driver saw last
    speed: Array  # that it makes of the angles
    current: Array


class Regulator(NamedTuple):
    """PID with gravity compensation, n joints, efforts at the joint.  (5.17), Table 5.4"""

    proportional: Array  # K_p
    derivative: Array  # K_d
    integral: Array  # K_i; 0 for PD
    gravity: float  # how much of the gravity is compensated: 0.9 of the masses, 1, or 0


class Device(NamedTuple):
    """What lies between hand and arm."""

    motion: float  # of the arm over that of the hand
    force: float  # felt over estimated
    strongest: float  # [N] that it can make
    step: float  # [m] of its position; 0 for none
