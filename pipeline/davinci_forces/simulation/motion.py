"""What truly happens in a recording: its motion and efforts, and the parameters that its joint models truly have."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, motion
from davinci_forces.maths.mechanics import kinematics
from davinci_forces.maths.mechanics.bodies import Bodies, Drives
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.physical import reduced_parameters
from davinci_forces.maths.simulation.closed_loop import JointConstraints, Timing, arm, simulate
from davinci_forces.maths.simulation.surroundings import UP, Surroundings
from davinci_forces.simulation.scenario.scenario import BadScenario, Scenario, SimulatedArm, SimulatedLog

EXACT = 1e-9  # size up to which a parameter that a model lacks counts as 0, in SI
DIGITS = 12  # of a true parameter that follows from the links: rounding differs from machine to machine beyond


@dataclass(frozen=True)
class SimulatedMotion:
    """What truly happened at one joint, at the recorder's instants; every array is (N,)."""

    q: Array
    dq: Array
    tau: Array  # what the motor gave
    tau_ext: Array  # what the joint exerted on its surroundings


@dataclass(frozen=True)
class SimulatedRun:
    """What truly happened in one recording: its clock (N,) [s], its joints, and the tip where it is known."""

    t: Array
    motions: dict[str, SimulatedMotion]
    force: Array | None = None  # (N, 3) [N] of the tip on its surroundings, base frame


def simulated(scenario: Scenario, log: SimulatedLog) -> SimulatedRun:
    """One recording: of the whole arm in closed loop, or joint by joint; raises as `_in_closed_loop` does."""
    return _in_closed_loop(scenario, log) if scenario.arm else _prescribed(scenario, log)


def _prescribed(scenario: Scenario, log: SimulatedLog) -> SimulatedRun:
    """Joints that follow their trajectories exactly: the independent joint models, run backwards.  Section 6.1"""
    t = np.arange(round(log.duration * scenario.rate)) / scenario.rate
    return SimulatedRun(t, {name: _joint_motion(scenario, log, name, t) for name in log.joints})


def _joint_motion(scenario: Scenario, log: SimulatedLog, name: str, t: Array) -> SimulatedMotion:
    simulated, move = scenario.joints[name], log.moves.get(name)
    if isinstance(move, Fourier):
        q, dq, ddq = motion(move, t)
    else:
        q, dq, ddq = log.position(name, t), np.zeros_like(t), np.zeros_like(t)
    tau_ext = sum((push.at(t) for push in log.external.get(name, ())), np.zeros_like(t))
    tau = regressor(simulated.joint.terms, q, dq, ddq) @ np.array(simulated.theta) + tau_ext
    return SimulatedMotion(q, dq, tau, tau_ext)


def _in_closed_loop(scenario: Scenario, log: SimulatedLog) -> SimulatedRun:
    """The whole arm, from rest at the first position asked for; the lead is run and not recorded.

    Raises
    ------
    BadScenario
        If the motion grows beyond all bounds, as it does under gains that the ticks are too slow for.
    """
    simulated_arm, robot = cast(SimulatedArm, scenario.arm), scenario.robot
    chain, bodies = _geometry(scenario)
    names, n = [joint.name for joint in robot.joints], len(robot.joints)
    ticks = round(1 / (scenario.rate * simulated_arm.tick))
    skipped, samples = round(log.lead * scenario.rate), round(log.duration * scenario.rate)
    t = np.arange(-skipped, samples) / scenario.rate
    reference = np.column_stack([log.position(name, t) for name in names])
    stops = np.array([scenario.joints[name].stops for name in names])
    friction = simulated_arm.families[log.family].friction
    body = JointConstraints(friction, stops[:, 0].copy(), stops[:, 1].copy(), np.ones(n, dtype=np.bool_))
    plant = arm(chain, bodies, simulated_arm.motors.gear_ratio**2 * simulated_arm.rotors)
    clock = Timing(simulated_arm.tick, ticks)
    instants = np.arange(len(t) * ticks, dtype=np.float64) * simulated_arm.tick - log.lead
    around = _around(log, chain, names, instants)
    simulated = simulate(
        plant, body, simulated_arm.motors, simulated_arm.control, clock, reference, around, reference[0]
    )
    if not all(np.isfinite(values).all() for values in simulated):
        raise BadScenario(
            f"{scenario.name}: log {log.name}: the loop is unstable; lower its gains, or shorten arm.tick"
        )
    q, dq, tau, tau_ext, force = (values[skipped:] for values in simulated)
    motions = {
        name: SimulatedMotion(*(np.ascontiguousarray(values[:, i]) for values in (q, dq, tau, tau_ext)))
        for i, name in enumerate(names)
    }
    return SimulatedRun(t[skipped:], {name: motions[name] for name in log.joints}, force)


def _geometry(scenario: Scenario) -> tuple[Chain, Bodies]:
    return cast(Chain, scenario.robot.chain), cast(Bodies, scenario.robot.bodies)


def _around(log: SimulatedLog, chain: Chain, names: list[str], t: Array) -> Surroundings:
    """What the arm touches at the ticks t (T,) [s]."""
    efforts, forces = np.zeros((len(t), len(names))), np.zeros((len(t), 3))
    for i, name in enumerate(names):
        for push in log.external.get(name, ()):
            efforts[:, i] += push.at(t)
    for push in log.tip:
        forces += np.outer(push.at(t), np.array(push.direction))
    surface, tissue = np.zeros(3), log.tissue
    if tissue:
        q = [tissue.surface if name in log.moves else log.held.get(name, 0.0) for name in names]
        surface = np.array(kinematics.tip(chain, q))
    stiffness, damping = (tissue.stiffness, tissue.damping) if tissue else (0.0, 0.0)
    return Surroundings(
        efforts, forces, log.mass, stiffness, damping, surface, UP.copy(), bool(log.tip) or tissue is not None
    )


def hung_at(scenario: Scenario) -> Array:
    """Where the tip is at q = 0 from the remote centre (3,) [m], base axes: where a mass is hung."""
    chain, _ = _geometry(scenario)
    return np.asarray(kinematics.tip(chain, np.zeros(len(scenario.robot.joints))) - kinematics.remote_centre(chain))


def theta(scenario: Scenario, family: str) -> dict[str, Array]:
    """The parameters of each joint's model while the other joints stay at zero, where the model is exact.

    Friction is as the scenario states it; inertia and gravity follow from the links, to `DIGITS` digits, so that they
    are the same on every machine.  A joint whose friction has more to it than viscous and Coulomb friction has none.
    """
    simulated_arm = cast(SimulatedArm, scenario.arm)
    friction = simulated_arm.families[family].friction
    chain, bodies = _geometry(scenario)
    drives = Drives(simulated_arm.motors.gear_ratio, simulated_arm.rotors, friction.viscous, friction.coulomb_up)
    parameters = {}
    for i, joint in enumerate(scenario.robot.joints):
        plain = friction.coulomb_up[i] == friction.coulomb_down[i] == friction.static_up[i] == friction.static_down[i]
        if not plain or friction.bristle_stiffness[i] > 0:
            continue
        values = reduced_parameters(chain, bodies, i, len(scenario.robot.joints), drives)
        names = [term.name for term in joint.terms]
        if all(abs(value) < EXACT for name, value in values.items() if name not in names):
            theta = [values.get(name, 0.0) for name in names]
            parameters[joint.name] = np.array([float(f"{value:.{DIGITS}g}") for value in theta])
    return parameters
