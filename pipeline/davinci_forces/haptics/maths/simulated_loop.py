"""The haptic loop: hand, haptic device, link, arm with controller and friction, and tissue.

Time advances in ticks of the motor drivers.  At every message of the link the device sends the position of the hand,
which reaches the arm after a delay.  In each period of the controller, the controller follows the latest position, the
sensors are read, and a function estimates a force from the readings.  At every message of the link the latest force is
sent back; the device holds it until the next force arrives.  Between ticks the hand moves exactly,

    m ddx = F_H - K_H x - b dx - F,                                                                 (8.2), (8.5)

with the held force F, and the arm by one implicit step.  The tissue begins at the arm's position 0 and pushes back with

    f = max(K_T x + D dx, 0) (1 + mu dx / sqrt(dx^2 + w^2)),                                        (8.1)

where mu is its friction along the tool.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_and_store, compile_function, inline
from davinci_forces.maths.simulation.actuators import Device
from davinci_forces.maths.simulation.control import drive, follow, read
from davinci_forces.maths.simulation.step import middle, step

FRICTION_VELOCITY = 1e-3  # w [m/s]; at lower velocities the tissue's friction falls smoothly to 0


class Grip(NamedTuple):
    """The motion of the hand over a tick, x+ = Phi x + Gamma (F_H - F), or a prescribed path over ticks (T + 1, 2)."""

    Phi: Array  # (2, 2)
    Gamma: Array  # (2,) [m/N], [m/(s N)]
    path: Array  # (0, 2) if the hand moves freely


class FeltTissue(NamedTuple):
    """The tissue at positions of the arm above 0."""

    stiffness: float  # K_T [N/m]
    damping: float  # D [N s/m]
    friction: float  # mu, below 1


class Axis(NamedTuple):
    """The prismatic joint and its state, in few arrays, because each array takes time to compile and at each call.

    The first five are records (1,) with the fields of `Motors`, `Cascade`, `Friction`, `Loops` and of `at_rest`.
    """

    motors: Any
    law: Any
    friction: Any
    loops: Any
    state: Any
    tau: Array  # (1,) [N]
    inertia: Array  # (1, 1) [kg]
    gravity: Array  # (1,) [N]
    stops: tuple[Array, Array]  # (1,) each [m], from the tissue's surface
    exact: bool  # whether it follows its reference without error, without motor and controller


class Clocks(NamedTuple):
    """The tick [s], and periods and delays in ticks."""

    tick: float
    turn: int  # period of the controller and its sensors
    message: int  # period of the link
    out: int  # delay of a position on its way to the arm
    back: int  # delay of a force on its way back


class SensorReading(NamedTuple):
    """The sensor readings of one period of the controller."""

    q: float  # [m]
    dq: float  # [m/s]
    tau: float  # [N]
    force: float  # [N] true force on the tissue, which no sensor of the arm measures


class LoopRun(NamedTuple):
    """A simulated run: (T,) at the ticks; readings (K, 4) and estimated forces (K,) at the controller's periods."""

    t: Array
    x: Array  # [m] position of the hand
    dx: Array
    q: Array  # [m] position of the arm, from the tissue's surface
    true: Array  # [N] force of the arm on the tissue
    felt: Array  # [N] force of the device on the hand
    readings: Array
    estimates: Array  # [N]


def simulate(
    grip: Grip, device: Device, axis: Axis, tissue: FeltTissue, clocks: Clocks, push: Array, noise: Array,
    start: tuple[float, float], estimate: Callable[[SensorReading], float],
) -> LoopRun:  # fmt: skip
    """Simulate the loop over the ticks of `push`, F_H (T,) [N]; the hand begins at `start`, and the arm in its state.

    `noise` (K, 3) is the noise of position, velocity and effort.  `estimate` returns the force [N] for the readings of
    each period of the controller, in order.
    """
    T, turns = len(push), len(noise)
    hand, sent = np.array(start), np.zeros((-(-T // clocks.message) + 1, 3))
    readings, estimates, ticks = np.zeros((turns, 4)), np.zeros(turns), np.zeros((T, 5))
    for k in range(turns + 1):
        _run_period(k, grip, device, axis, tissue, clocks, push, noise, hand, sent, estimates, readings, ticks)
        if k < turns:
            estimates[k] = estimate(SensorReading(*readings[k].tolist()))
    x, dx, q, true, felt = ticks.T
    return LoopRun(clocks.tick * np.arange(T, dtype=float), x, dx, q, true, felt, readings, estimates)


@compile_function
def tissue_force(tissue: Any, x: float, dx: float) -> float:
    """The force [N] on the tissue."""
    if x <= 0.0:
        return 0.0
    force = max(tissue.stiffness * x + tissue.damping * dx, 0.0)
    return float(force * (1.0 + tissue.friction * dx / np.sqrt(dx * dx + FRICTION_VELOCITY * FRICTION_VELOCITY)))


@compile_and_store
def _run_period(
    k: int, grip: Any, device: Any, arm: Any, tissue: Any, clocks: Any, push: Any, noise: Any, hand: Any, sent: Any,
    estimates: Any, readings: Any, ticks: Any,
) -> None:  # fmt: skip
    """Advance hand and arm over the ticks of period k - 1, if there is one, and read the sensors of period k.

    `sent` has the position and velocity of the hand and the force, as each message transmits them.
    """
    motors, state, tau = arm.motors, arm.state, arm.tau
    for now in range((k - 1) * clocks.turn if k > 0 else -1, min(k * clocks.turn, len(push))):
        if now >= 0:
            force = _felt_force(device, clocks, now, sent, estimates)
            ticks[now, 0], ticks[now, 1], ticks[now, 2] = hand[0], hand[1], state.q[0]
            ticks[now, 3], ticks[now, 4] = tissue_force(tissue, state.q[0], state.dq[0]), force
            if not arm.exact:
                _move_arm(arm, tissue, clocks.tick)
            _move_hand(grip, hand, push[now] - force, now)
        if now + 1 < len(push):
            _control(device, arm, clocks, now + 1, hand, sent)
    if k < len(noise):
        motor_angle, resolution = motors.gear_ratio[0] * (state.q[0] + noise[k, 0]), motors.encoder_step[0]
        if resolution > 0.0:
            motor_angle = resolution * np.rint(motor_angle / resolution)
        readings[k, 0] = motor_angle / motors.gear_ratio[0]
        readings[k, 1] = state.dq[0] + noise[k, 1]
        readings[k, 2] = tau[0] + noise[k, 2]
        readings[k, 3] = tissue_force(tissue, state.q[0], state.dq[0])


@inline
def _control(device: Any, arm: Any, clocks: Any, now: int, hand: Any, sent: Any) -> None:
    """Send the motion of the hand as the device measures it, and set the motor's effort of this tick."""
    state, angle, reference, tick = arm.state, np.empty(1), np.empty(1), now % clocks.turn
    if now % clocks.message == 0:
        x = device.step * np.rint(hand[0] / device.step) if device.step > 0.0 else hand[0]
        sent[now // clocks.message, 0], sent[now // clocks.message, 1] = x, hand[1]
    received = max(now - clocks.out, 0) // clocks.message
    reference[0] = device.motion * sent[received, 0]
    if not arm.exact:
        read(arm.motors, state.q, angle)
        if now == 0:
            arm.loops.angle[0] = angle[0]
        if tick == 0:
            follow(arm.motors, arm.law, arm.loops, reference, angle, clocks.tick * clocks.turn)
        drive(arm.motors, arm.law, arm.loops, angle, state.dq, (tick + 1) / clocks.turn, clocks.tick, arm.tau)
    elif tick == 0:
        state.q[0], state.dq[0] = reference[0], device.motion * sent[received, 1]


@inline
def _felt_force(device: Any, clocks: Any, now: int, sent: Any, estimates: Any) -> float:
    """Send the latest force, and return the force of the device on the hand."""
    if now % clocks.message == 0:
        sent[now // clocks.message, 2] = estimates[now // clocks.turn]
    force = device.force * sent[(now - clocks.back) // clocks.message, 2] if now >= clocks.back else 0.0
    return float(min(max(force, -device.strongest), device.strongest))


@inline
def _move_arm(arm: Any, tissue: Any, h: float) -> None:
    q, dq, free = np.empty(1), np.empty(1), np.empty(1)
    middle(arm.state, h, q, dq)
    free[0] = arm.tau[0] - tissue_force(tissue, q[0], dq[0])
    step(arm.inertia, arm.gravity, free, arm.friction, arm.stops[0], arm.stops[1], arm.state, h)


@inline
def _move_hand(grip: Any, hand: Any, net: float, now: int) -> None:
    if len(grip.path):
        hand[0], hand[1] = grip.path[now + 1, 0], grip.path[now + 1, 1]
        return
    x, dx = hand[0], hand[1]
    for i in range(2):
        hand[i] = grip.Phi[i, 0] * x + grip.Phi[i, 1] * dx + grip.Gamma[i] * net
