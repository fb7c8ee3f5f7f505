"""Parameters of motors, controllers and the haptic device, without compiled code, so that files are read quickly."""

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
    encoder_step: Array  # [rad] at the motor; 0 for a continuous encoder


class Cascade(NamedTuple):
    """Position, velocity and current PI loops of n joints, in the motors' units.  Fig 2.5

    The position loop runs in the controller, the velocity and current loops in the motor driver.
    """

    position_p: Array  # [1/s]
    position_i: Array  # [1/s^2]
    velocity_p: Array  # [A s/rad]
    velocity_i: Array  # [A/rad]
    current_p: Array  # [V/A]
    current_i: Array  # [V/(A s)]
    velocity_filter: Array  # [s] time constant of the low-pass filter of the driver's velocity, a difference of angles


class Loops(NamedTuple):
    """The state of the cascades of n joints, in the motors' units; every array is (n,)."""

    position_i: Array  # integral of each loop
    velocity_i: Array
    current_i: Array
    last: Array  # reference velocity of the previous period of the controller, then of the current period
    wanted: Array
    angle: Array  # last angle that the driver measured
    speed: Array  # velocity that the driver computes from the angles
    current: Array


class Regulator(NamedTuple):
    """PID with gravity compensation, n joints, efforts at the joint.  (5.17), Table 5.4"""

    proportional: Array  # K_p
    derivative: Array  # K_d
    integral: Array  # K_i; 0 for PD
    gravity: float  # share of gravity that is compensated: 0 to 1; 0.9 where the compensator has 0.9 of the masses


class Device(NamedTuple):
    """The haptic device between hand and arm."""

    motion: float  # motion of the arm over motion of the hand
    force: float  # felt force over estimated force
    strongest: float  # [N] largest force of the device
    step: float  # [m] resolution of its position sensor; 0 for a continuous one
