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
from davinci_forces.maths.compiled import compile_and_store, compile_function
from davinci_forces.maths.simulation.actuators import Cascade, Device, Loops, Motors
from davinci_forces.maths.simulation.control import drive, follow, read
from davinci_forces.maths.simulation.step import Friction, State, at_rest, middle, step

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
    """The prismatic joint: motor, controller, body and friction, as arrays of one joint."""

    inertia: Array  # (1, 1) [kg]
    gravity: Array  # (1,) [N]
    friction: Friction
    motors: Motors
    law: Cascade
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


class _Loop(NamedTuple):
    """The state of the loop, in few arrays, because each argument of compiled code takes time at every call."""

    hand: Array  # (2,)
    state: Array  # (4, 1), a `State`
    loops: Array  # (8, 1), `Loops`
    last: Array  # (3, 1): effort and angle of the motor, and the last estimated force
    sent_motion: Array  # (messages, 2) position and velocity of the hand
    sent_forces: Array  # (messages,) [N]


class _Plant(NamedTuple):
    """The constants of the axis, in few arrays for the same reason."""

    motors: Array  # (7, 1)
    law: Array  # (7, 1)
    friction: Array  # (8, 1)
    body: Array  # (4, 1): inertia, gravity, and both stops
    exact: bool


def simulate(
    grip: Grip, device: Device, axis: Axis, tissue: FeltTissue, clocks: Clocks, push: Array, noise: Array,
    start: tuple[float, float], estimate: Callable[[SensorReading], float],
) -> LoopRun:  # fmt: skip
    """Simulate the loop over the ticks of `push`, F_H (T,) [N]; the hand begins at `start`, and the arm at rest there.

    `noise` (K, 3) is the noise of position, velocity and effort.  `estimate` returns the force [N] for the readings of
    each period of the controller, in order.
    """
    T, turns = len(push), len(noise)
    messages = -(-T // clocks.message) + 1
    state, loops = np.array(at_rest(np.array([device.motion * start[0]]))), np.zeros((8, 1))
    read(axis.motors, state[0], loops[Loops._fields.index("angle")])
    loop = _Loop(np.array(start), state, loops, np.zeros((3, 1)), np.zeros((messages, 2)), np.zeros(messages))
    body = np.array([axis.inertia[0], axis.gravity, *axis.stops])
    plant = _Plant(np.array(axis.motors), np.array(axis.law), np.array(axis.friction), body, axis.exact)
    readings, estimates, ticks = np.zeros((turns, 4)), np.zeros(turns), np.zeros((T, 5))
    for k in range(turns):
        _sense(device, plant, tissue, clocks, noise, loop, k, readings)
        estimates[k] = loop.last[2, 0] = estimate(SensorReading(*readings[k].tolist()))
        _run_ticks(grip, device, plant, tissue, clocks, push, loop, k, ticks)
    x, dx, q, true, felt = ticks.T
    return LoopRun(clocks.tick * np.arange(T, dtype=float), x, dx, q, true, felt, readings, estimates)


@compile_function
def tissue_force(tissue: Any, x: float, dx: float) -> float:
    """The force [N] on the tissue."""
    if x <= 0.0:
        return 0.0
    force = max(tissue.stiffness * x + tissue.damping * dx, 0.0)
    return float(force * (1.0 + tissue.friction * dx / np.sqrt(dx * dx + FRICTION_VELOCITY * FRICTION_VELOCITY)))


@compile_function
def _parts(plant: Any, loop: Any) -> Any:
    """Motors, law, friction, loops and state as named tuples of rows."""
    m, c, f, i, s = plant.motors, plant.law, plant.friction, loop.loops, loop.state
    return (
        Motors(m[0], m[1], m[2], m[3], m[4], m[5], m[6]),
        Cascade(c[0], c[1], c[2], c[3], c[4], c[5], c[6]),
        Friction(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7]),
        Loops(i[0], i[1], i[2], i[3], i[4], i[5], i[6], i[7]),
        State(s[0], s[1], s[2], s[3]),
    )


@compile_and_store
def _sense(device: Any, plant: Any, tissue: Any, clocks: Any, noise: Any, loop: Any, k: int, readings: Any) -> None:
    """Start a period of the controller: follow the latest reference and read the sensors."""
    now, h = k * clocks.turn, clocks.tick
    if now % clocks.message == 0:
        _send_motion(device, loop, now // clocks.message)
    reference = device.motion * loop.sent_motion[max(now - clocks.out, 0) // clocks.message]
    motors, law, _, loops, state = _parts(plant, loop)
    tau, angle = loop.last[0], loop.last[1]
    if plant.exact:
        state.q[0], state.dq[0] = reference[0], reference[1]
    else:
        read(motors, state.q, angle)
        follow(motors, law, loops, reference[:1], angle, h * clocks.turn)
        drive(motors, law, loops, angle, state.dq, 1.0 / clocks.turn, h, tau)
    motor_angle, resolution = motors.gear_ratio[0] * (state.q[0] + noise[k, 0]), motors.encoder_step[0]
    if resolution > 0.0:
        motor_angle = resolution * np.round(motor_angle / resolution)
    readings[k, 0] = motor_angle / motors.gear_ratio[0]
    readings[k, 1] = state.dq[0] + noise[k, 1]
    readings[k, 2] = tau[0] + noise[k, 2]
    readings[k, 3] = tissue_force(tissue, state.q[0], state.dq[0])


@compile_function
def _send_motion(device: Any, loop: Any, message: int) -> None:
    """Send the position and velocity of the hand, as the device measures them."""
    x = loop.hand[0]
    loop.sent_motion[message, 0] = device.step * np.round(x / device.step) if device.step > 0.0 else x
    loop.sent_motion[message, 1] = loop.hand[1]


@compile_and_store
def _run_ticks(
    grip: Any, device: Any, plant: Any, tissue: Any, clocks: Any, push: Any, loop: Any, k: int, ticks: Any
) -> None:
    """Advance hand and arm by the ticks of one period of the controller."""
    motors, law, friction, loops, state = _parts(plant, loop)
    tau, angle, h = loop.last[0], loop.last[1], clocks.tick
    for tick in range(min(clocks.turn, len(push) - k * clocks.turn)):
        now = k * clocks.turn + tick
        if now % clocks.message == 0:
            if tick > 0:
                _send_motion(device, loop, now // clocks.message)
            loop.sent_forces[now // clocks.message] = loop.last[2, 0]
        if tick > 0 and not plant.exact:
            read(motors, state.q, angle)
            drive(motors, law, loops, angle, state.dq, (tick + 1) / clocks.turn, h, tau)
        force = device.force * loop.sent_forces[(now - clocks.back) // clocks.message] if now >= clocks.back else 0.0
        force = min(max(force, -device.strongest), device.strongest)
        true = tissue_force(tissue, state.q[0], state.dq[0])
        ticks[now, 0], ticks[now, 1], ticks[now, 2] = loop.hand[0], loop.hand[1], state.q[0]
        ticks[now, 3], ticks[now, 4] = true, force
        if not plant.exact:
            _move_arm(plant.body, friction, tissue, tau, state, h)
        _move_hand(grip, loop.hand, push[now] - force, now)


@compile_function
def _move_arm(body: Any, friction: Any, tissue: Any, tau: Any, state: Any, h: float) -> None:
    """Advance the arm by one tick."""
    q, dq, free = np.empty(1), np.empty(1), np.empty(1)
    middle(state, h, q, dq)
    free[0] = tau[0] - tissue_force(tissue, q[0], dq[0])
    step(body[:1], body[1], free, friction, body[2], body[3], state, np.ones(1, np.bool_), h)


@compile_function
def _move_hand(grip: Any, hand: Any, net: float, now: int) -> None:
    """Advance the hand by one tick, under a constant net force [N]."""
    if len(grip.path):
        hand[0], hand[1] = grip.path[now + 1, 0], grip.path[now + 1, 1]
        return
    x, dx = hand[0], hand[1]
    for i in range(2):
        hand[i] = grip.Phi[i, 0] * x + grip.Phi[i, 1] * dx + grip.Gamma[i] * net
