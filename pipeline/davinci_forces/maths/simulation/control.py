"""Controllers: PD with gravity compensation and PID of chapter 5, and the laboratory's three cascaded PI loops.

The PI loops run in discrete time, for n joints.
"""

from math import exp
from typing import Any

import numpy as np

from davinci_forces.maths.compiled import compile_function
from davinci_forces.maths.simulation.actuators import Motors


@compile_function
def pi(error: float, p: float, i: float, integral: float, h: float, limit: float) -> tuple[float, float]:
    """Advance a PI loop by h [s]: its output, clipped at the limit, and its integral, which stops growing there."""
    output = p * error + integral + i * h * error
    if output > limit:
        return limit, min(integral, max(limit - p * error, 0.0))
    if output < -limit:
        return -limit, max(integral, min(-limit - p * error, 0.0))
    return output, integral + i * h * error


@compile_function
def current_after(motors: Motors, j: int, current: float, voltage: float, speed: float, h: float) -> float:
    """The motor current after h [s] of constant voltage and motor speed [rad/s]: the exact solution of (A.5)."""
    decay = exp(-h * motors.resistance[j] / motors.inductance[j])
    final = (voltage - motors.torque_constant[j] * speed) / motors.resistance[j]
    return float(final + (current - final) * decay)


@compile_function
def follow(motors: Any, law: Any, loops: Any, reference: Any, angle: Any, period: float) -> None:
    """Advance the position loop, which sets the drivers' reference velocity, by a `period` [s] of the controller."""
    for j in range(len(angle)):
        error, loops.last[j] = motors.gear_ratio[j] * reference[j] - angle[j], loops.wanted[j]
        loops.wanted[j], loops.position_i[j] = pi(
            error, law.position_p[j], law.position_i[j], loops.position_i[j], period, np.inf
        )


@compile_function
def drive(motors: Any, law: Any, loops: Any, angle: Any, dq: Any, share: float, h: float, tau: Any) -> None:
    """Advance the velocity and current loops by one tick of h [s], and fill the efforts at the joints tau (n,).

    The drivers ramp to a new reference velocity over one period of the controller; `share` of the period is over.  A
    step in place of the ramp would disturb the current whenever it is recorded.
    """
    for j in range(len(angle)):
        gain = h / (law.velocity_filter[j] + h)
        loops.speed[j] += gain * ((angle[j] - loops.angle[j]) / h - loops.speed[j])
        loops.angle[j] = angle[j]
        error = loops.last[j] + (loops.wanted[j] - loops.last[j]) * share - loops.speed[j]
        wanted_current, loops.velocity_i[j] = pi(
            error, law.velocity_p[j], law.velocity_i[j], loops.velocity_i[j], h, motors.current_limit[j]
        )
        error = wanted_current - loops.current[j]
        voltage, loops.current_i[j] = pi(
            error, law.current_p[j], law.current_i[j], loops.current_i[j], h, motors.voltage_limit[j]
        )
        motor_speed = motors.gear_ratio[j] * dq[j]
        loops.current[j] = current_after(motors, j, loops.current[j], voltage, motor_speed, h)
        tau[j] = motors.gear_ratio[j] * motors.torque_constant[j] * loops.current[j]


@compile_function
def read(motors: Any, q: Any, angle: Any) -> None:
    """Fill the motors' angles (n,) [rad] as the encoders measure them.  (6.28)"""
    for j in range(len(q)):
        angle[j] = motors.gear_ratio[j] * q[j]
        if motors.encoder_step[j] > 0:
            angle[j] = motors.encoder_step[j] * np.rint(angle[j] / motors.encoder_step[j])
