"""A hand that feels the tissue through an arm: haptic device, link, controller, friction and tissue in one loop.

Time goes in ticks of the motor drivers.  At every message of the link the device reads where the hand is, and sends it;
the arm receives it later, and at every turn its controller follows the latest one it has.  At the same turn its
sensors are read, and whoever simulates makes a force of them; at every message of the link the latest force is sent
back, and the device holds it until the next one is there.  Between ticks the hand moves exactly,

    m ddx = F_H - K_H x - b dx - F,                                                                 (8.2), (8.5)

with the force F that is held, and the arm by one implicit step.  Tissue begins where the arm is at 0, and pushes back

    f = max(K_T x + D dx, 0) (1 + mu dx / sqrt(dx^2 + w^2)),                                        (8.1)

with mu its friction along the tool.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import cached, compiled
from davinci_forces.maths.simulation.actuators import Cascade, Device, Loops, Motors
from davinci_forces.maths.simulation.control import drive, follow, read
from davinci_forces.maths.simulation.step import Friction, State, at_rest, middle, step

RUBBING = 1e-3  # w [m/s], below which the tissue's friction gives way


class Grip(NamedTuple):
    """How the hand moves over a tick, x+ = Phi x + Gamma (F_H - F), or where it is put at the ticks, (T + 1, 2)."""

    Phi: Array  # (2, 2)
    Gamma: Array  # (2,) [m/N], [m/(s N)]
    put: Array  # (0, 2) where it moves by itself


class FeltTissue(NamedTuple):
    """What the tip of the arm touches beyond 0."""

    stiffness: float  # K_T [N/m]
    damping: float  # D [N s/m]
    friction: float  # mu, below 1


class Axis(NamedTuple):
    """The joint that slides, alone: motor, controller, body and friction; every array is of one joint."""

    inertia: Array  # (1, 1) [kg]
    gravity: Array  # (1,) [N]
    friction: Friction
    motors: Motors
    law: Cascade
    stops: tuple[Array, Array]  # (1,) each [m], from the tissue's surface
    exact: bool  # whether it is, rather, wherever it was last told to be


class Clocks(NamedTuple):
    """Everything in ticks, but the tick [s]."""

    tick: float
    turn: int  # of the controller and its sensors
    message: int  # of the link
    out: int  # how late a position is
    back: int  # how late a force is


class SensorReading(NamedTuple):
    """What the sensors say at a turn of the controller."""

    q: float  # [m]
    dq: float  # [m/s]
    tau: float  # [N]
    force: float  # [N] that the tissue truly takes, which no sensor of the arm says


class Felt(NamedTuple):
    """What happened: (T,) at the ticks, and (K, 4) readings and (K,) forces made of them at the controller's turns."""

    t: Array
    x: Array  # the hand
    dx: Array
    q: Array  # the arm, from the tissue's surface
    true: Array  # [N] what the arm exerts on the tissue
    felt: Array  # [N] what pushes the hand back
    readings: Array
    made: Array


class _Loop(NamedTuple):
    """All that changes, in few arrays: what is handed to compiled code takes its time, turn by turn."""

    hand: Array  # (2,)
    state: Array  # (4, 1), a `State`
    loops: Array  # (8, 1), `Loops`
    last: Array  # (3, 1): effort and angle of the motor, and the force that was made last
    said: Array  # (messages, 2) position and velocity of the hand, as sent
    forces: Array  # (messages,) as sent


class _Fixed(NamedTuple):
    """The axis, likewise."""

    motors: Array  # (7, 1)
    law: Array  # (7, 1)
    friction: Array  # (8, 1)
    body: Array  # (4, 1): inertia, gravity, and both stops
    exact: bool


def simulate(
    grip: Grip, device: Device, axis: Axis, tissue: FeltTissue, clocks: Clocks, push: Array, noise: Array,
    start: tuple[float, float], make: Callable[[SensorReading], float],
) -> Felt:  # fmt: skip
    """The loop over as many ticks as there is `push`, F_H (T,) [N], from a hand at `start` and an arm at rest there.

    `noise` (K, 3) is what the sensors add to position, velocity and effort, and `make` the force [N] that is made of
    their readings, one turn of the controller after the other.
    """
    T, turns = len(push), len(noise)
    messages = -(-T // clocks.message) + 1
    state, loops = np.array(at_rest(np.array([device.motion * start[0]]))), np.zeros((8, 1))
    read(axis.motors, state[0], loops[Loops._fields.index("angle")])
    loop = _Loop(np.array(start), state, loops, np.zeros((3, 1)), np.zeros((messages, 2)), np.zeros(messages))
    body = np.array([axis.inertia[0], axis.gravity, *axis.stops])
    fixed = _Fixed(np.array(axis.motors), np.array(axis.law), np.array(axis.friction), body, axis.exact)
    readings, made, ticks = np.zeros((turns, 4)), np.zeros(turns), np.zeros((T, 5))
    for k in range(turns):
        _sense(device, fixed, tissue, clocks, noise, loop, k, readings)
        made[k] = loop.last[2, 0] = make(SensorReading(*readings[k].tolist()))
        _move(grip, device, fixed, tissue, clocks, push, loop, k, ticks)
    x, dx, q, true, felt = ticks.T
    return Felt(clocks.tick * np.arange(T, dtype=float), x, dx, q, true, felt, readings, made)


@compiled
def pressed(tissue: Any, x: float, dx: float) -> float:
    """The force [N] on the tissue."""
    if x <= 0.0:
        return 0.0
    force = max(tissue.stiffness * x + tissue.damping * dx, 0.0)
    return float(force * (1.0 + tissue.friction * dx / np.sqrt(dx * dx + RUBBING * RUBBING)))


@compiled
def _parts(fixed: Any, loop: Any) -> Any:
    """Motors, law, friction, loops and state, row by row."""
    m, c, f, i, s = fixed.motors, fixed.law, fixed.friction, loop.loops, loop.state
    return (
        Motors(m[0], m[1], m[2], m[3], m[4], m[5], m[6]),
        Cascade(c[0], c[1], c[2], c[3], c[4], c[5], c[6]),
        Friction(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7]),
        Loops(i[0], i[1], i[2], i[3], i[4], i[5], i[6], i[7]),
        State(s[0], s[1], s[2], s[3]),
    )


@cached
def _sense(device: Any, fixed: Any, tissue: Any, clocks: Any, noise: Any, loop: Any, k: int, readings: Any) -> None:
    """A turn of the controller begins: it follows what it was told, and the sensors are read."""
    now, h = k * clocks.turn, clocks.tick
    if now % clocks.message == 0:
        _say(device, loop, now // clocks.message)
    wanted = device.motion * loop.said[max(now - clocks.out, 0) // clocks.message]
    motors, law, _, loops, state = _parts(fixed, loop)
    tau, angle = loop.last[0], loop.last[1]
    if fixed.exact:
        state.q[0], state.dq[0] = wanted[0], wanted[1]
    else:
        read(motors, state.q, angle)
        follow(motors, law, loops, wanted[:1], angle, h * clocks.turn)
        drive(motors, law, loops, angle, state.dq, 1.0 / clocks.turn, h, tau)
    turned, resolved = motors.gear_ratio[0] * (state.q[0] + noise[k, 0]), motors.encoder_step[0]
    if resolved > 0.0:
        turned = resolved * np.round(turned / resolved)
    readings[k, 0] = turned / motors.gear_ratio[0]
    readings[k, 1] = state.dq[0] + noise[k, 1]
    readings[k, 2] = tau[0] + noise[k, 2]
    readings[k, 3] = pressed(tissue, state.q[0], state.dq[0])


@compiled
def _say(device: Any, loop: Any, message: int) -> None:
    """The device reads where the hand is."""
    x = loop.hand[0]
    loop.said[message, 0] = device.step * np.round(x / device.step) if device.step > 0.0 else x
    loop.said[message, 1] = loop.hand[1]


@cached
def _move(
    grip: Any, device: Any, fixed: Any, tissue: Any, clocks: Any, push: Any, loop: Any, k: int, ticks: Any
) -> None:
    """The ticks of one turn of the controller, hand and arm side by side."""
    motors, law, rubbing, loops, state = _parts(fixed, loop)
    tau, angle, h = loop.last[0], loop.last[1], clocks.tick
    for tick in range(min(clocks.turn, len(push) - k * clocks.turn)):
        now = k * clocks.turn + tick
        if now % clocks.message == 0:
            if tick > 0:
                _say(device, loop, now // clocks.message)
            loop.forces[now // clocks.message] = loop.last[2, 0]
        if tick > 0 and not fixed.exact:
            read(motors, state.q, angle)
            drive(motors, law, loops, angle, state.dq, (tick + 1) / clocks.turn, h, tau)
        force = device.force * loop.forces[(now - clocks.back) // clocks.message] if now >= clocks.back else 0.0
        force = min(max(force, -device.strongest), device.strongest)
        true = pressed(tissue, state.q[0], state.dq[0])
        ticks[now, 0], ticks[now, 1], ticks[now, 2] = loop.hand[0], loop.hand[1], state.q[0]
        ticks[now, 3], ticks[now, 4] = true, force
        if not fixed.exact:
            _slide(fixed.body, rubbing, tissue, tau, state, h)
        _hold(grip, loop.hand, push[now] - force, now)


@compiled
def _slide(body: Any, rubbing: Any, tissue: Any, tau: Any, state: Any, h: float) -> None:
    """One step of the arm."""
    at, velocity, free = np.empty(1), np.empty(1), np.empty(1)
    middle(state, h, at, velocity)
    free[0] = tau[0] - pressed(tissue, at[0], velocity[0])
    step(body[:1], body[1], free, rubbing, body[2], body[3], state, np.ones(1, np.bool_), h)


@compiled
def _hold(grip: Any, hand: Any, net: float, now: int) -> None:
    """One step of the hand, under a force that is constant."""
    if len(grip.put):
        hand[0], hand[1] = grip.put[now + 1, 0], grip.put[now + 1, 1]
        return
    x, dx = hand[0], hand[1]
    for i in range(2):
        hand[i] = grip.Phi[i, 0] * x + grip.Phi[i, 1] * dx + grip.Gamma[i] * net
