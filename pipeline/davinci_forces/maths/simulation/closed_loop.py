"""A robot in closed loop: motors, motor drivers, controller, friction, end stops and surroundings.

Time advances in ticks of the motor drivers.  At every n-th tick the controller reads the encoders and sets the drivers'
commands, and a sample is recorded.  Between ticks the rigid body moves by one implicit step.
"""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_and_store, compile_function
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain, Tree, fold_fixed_links, tree_of
from davinci_forces.maths.mechanics.kernels import mass_and_bias, place_and_jacobian
from davinci_forces.maths.simulation.actuators import Cascade, Loops, Motors, Regulator
from davinci_forces.maths.simulation.control import drive, follow, pi, read
from davinci_forces.maths.simulation.step import Friction, at_rest, middle, step
from davinci_forces.maths.simulation.surroundings import Surroundings, on_tip, weigh


class Plant(NamedTuple):
    """The rigid body: the arm, its rotors and its tip."""

    tree: Tree
    rotors: Array  # eta^2 J_m (n,)
    body: int  # body to which the tip is fixed
    tip: tuple[float, float, float]  # in that body's frame [m]


class JointConstraints(NamedTuple):
    """Friction and end stops of n joints."""

    friction: Friction
    lower: Array  # end stops (n,)
    upper: Array


class Timing(NamedTuple):
    """The clocks of drivers and controller."""

    tick: float  # [s] period of the motor drivers
    ticks: int  # ticks in one period of the controller


class Simulated(NamedTuple):
    """The true motion and efforts at the controller's instants; arrays are (K, n), except `force` (K, 3) [N]."""

    q: Array
    dq: Array
    tau: Array  # effort of the motors at the joints
    tau_ext: Array  # effort exerted on the surroundings
    force: Array  # of the tip on the surroundings, base frame


def arm(chain: Chain, bodies: Bodies, rotors: Array) -> Plant:
    """The plant of an arm with n joints and their `rotors` (n,), eta^2 J_m; later coordinates stay at rest at 0."""
    n = len(rotors)
    chain, parameters = fold_fixed_links(chain.with_coordinates(n), bodies.parameters(n).reshape(-1, 10))
    frame = chain.names.index(chain.tip)
    x, y, z = chain.offset[frame, :3, 3].tolist()
    tree = tree_of(chain, parameters)
    return Plant(tree, rotors.astype(np.float64), int(chain.body[frame]), (x, y, z))


@compile_function
def dynamics(plant: Any, q: Any, dq: Any, M: Any, b: Any) -> None:
    """Fill M (n, n), rotors included, and b (n,) = C dq + G.  (A.12)"""
    mass_and_bias(plant.tree, GRAVITY, q, dq, M, b)
    for i in range(len(q)):
        M[i, i] += plant.rotors[i]


def simulate(
    plant: Plant, body: JointConstraints, motors: Motors, law: Cascade | Regulator, timing: Timing, reference: Array,
    around: Surroundings, q: Array,
) -> Simulated:  # fmt: skip
    """Run the closed loop from rest at q (n,); `reference` (K, n) are positions at the controller's K instants."""
    K, n = reference.shape
    out, state = Simulated(*(np.zeros((K, width)) for width in (n, n, n, n, 3))), at_rest(q)
    run = _cascade if isinstance(law, Cascade) else _regulator
    run(plant, body, motors, law, timing, reference, around, state, out)
    return out


@compile_and_store
def _cascade(
    plant: Any, body: Any, motors: Any, law: Any, timing: Any, reference: Any, around: Any, state: Any, out: Any
) -> None:
    """Simulate three cascaded PI loops for each joint.  Fig 2.5"""
    n, h = len(state.q), timing.tick
    loops = Loops(
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    )
    tau, angle = np.zeros(n), np.zeros(n)
    read(motors, state.q, loops.angle)
    for k in range(len(reference)):
        for tick in range(timing.ticks):
            read(motors, state.q, angle)
            if tick == 0:
                follow(motors, law, loops, reference[k], angle, h * timing.ticks)
            drive(motors, law, loops, angle, state.dq, (tick + 1) / timing.ticks, h, tau)
            _tick(plant, body, around, state, tau, h, k, tick, timing.ticks, out)


@compile_and_store
def _regulator(
    plant: Any, body: Any, motors: Any, law: Any, timing: Any, reference: Any, around: Any, state: Any, out: Any
) -> None:
    """Simulate PID with gravity compensation; the motors give the commanded effort up to their current limit."""
    n, period = len(state.q), timing.tick * timing.ticks
    M, G, zero, integral, tau = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    angle, before = np.zeros(n), np.zeros(n)
    read(motors, state.q, before)
    for k in range(len(reference)):
        read(motors, state.q, angle)
        dynamics(plant, angle / motors.gear_ratio, zero, M, G)
        for j in range(n):
            error = reference[k, j] - angle[j] / motors.gear_ratio[j]
            damping = law.derivative[j] * (angle[j] - before[j]) / (period * motors.gear_ratio[j])
            limit = motors.gear_ratio[j] * motors.torque_constant[j] * motors.current_limit[j]
            output, integral[j] = pi(error, law.proportional[j], law.integral[j], integral[j], period, limit)
            tau[j], before[j] = min(max(output + (law.gravity * G[j] - damping), -limit), limit), angle[j]
        for tick in range(timing.ticks):
            _tick(plant, body, around, state, tau, timing.tick, k, tick, timing.ticks, out)


@compile_function
def _tick(
    plant: Any, body: Any, around: Any, state: Any, tau: Any, h: float, k: int, tick: int, ticks: int, out: Any
) -> None:
    """Move for one tick with constant motor efforts tau (n,), and record at the controller's instants."""
    n, now = len(state.q), k * ticks + tick
    M, b, J, free = np.empty((n, n)), np.empty(n), np.zeros((3, n)), np.empty(n)
    q, dq, start = np.empty(n), np.empty(n), np.empty(n)
    external, force, drift, velocity = np.empty(n), np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(n):
        start[i], external[i] = state.dq[i], around.efforts[now, i]
    middle(state, h, q, dq)
    dynamics(plant, q, dq, M, b)
    if around.mass > 0:
        weigh(plant, q, dq, J, drift)
    if around.at_tip:
        x = np.array(place_and_jacobian(plant.tree, plant.body, plant.tip, q, J))
        _through(J, dq, velocity)
        on_tip(around, now, x, velocity, force)
    for i in range(n):
        for c in range(3):
            external[i] += J[c, i] * (force[c] + around.mass * drift[c])
            for j in range(n):
                M[i, j] += around.mass * J[c, i] * J[c, j]
        free[i] = tau[i] - external[i]
    if tick == 0:
        for i in range(n):
            out.q[k, i], out.dq[k, i], out.tau[k, i], out.tau_ext[k, i] = state.q[i], state.dq[i], tau[i], external[i]
        for c in range(3):
            out.force[k, c] = force[c]
    step(M, b, free, body.friction, body.lower, body.upper, state, h)
    if tick == 0 and around.mass > 0:  # add the effort and force of the mass's acceleration
        for i in range(n):
            dq[i] = (state.dq[i] - start[i]) / h
        _through(J, dq, velocity)
        for c in range(3):
            out.force[k, c] += around.mass * (velocity[c] + drift[c])
            for i in range(n):
                out.tau_ext[k, i] += around.mass * J[c, i] * velocity[c]


@compile_function
def _through(J: Any, dq: Any, velocity: Any) -> None:
    """Fill the velocity J dq (3,)."""
    for c in range(3):
        velocity[c] = 0.0
        for i in range(len(dq)):
            velocity[c] += J[c, i] * dq[i]
