"""The true motion and efforts of a simulated recording, and the true parameters of its joint models."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, motion
from davinci_forces.maths.mechanics import kinematics
from davinci_forces.maths.mechanics.bodies import Drives
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.physical import reduced_parameters
from davinci_forces.maths.simulation.closed_loop import JointConstraints, Timing, arm, simulate
from davinci_forces.maths.simulation.surroundings import UP, Surroundings
from davinci_forces.simulation.scenario import BadScenario, Scenario, SimulatedArm, SimulatedLog

NEGLIGIBLE = 1e-9  # in SI units: a parameter below this is 0, so that a model may omit it
SIGNIFICANT_DIGITS = 12  # digits of true parameters from the links; further digits depend on the machine


@dataclass(frozen=True)
class SimulatedMotion:
    """The true motion of one joint at the recorder's instants; every array is (N,)."""

    q: Array
    dq: Array
    tau: Array  # effort of the motor
    tau_ext: Array  # effort of the joint on its surroundings

    def interpolate(self, t: Array, instants: Array) -> "SimulatedMotion":
        """Interpolate the motion at the times t (N,) [s] to other instants (N,) [s]."""
        return SimulatedMotion(*(np.interp(instants, t, x) for x in (self.q, self.dq, self.tau, self.tau_ext)))


@dataclass(frozen=True)
class SimulatedRun:
    """The true motion of one recording: its clock (N,) [s], its joints, and the tip if it is simulated."""

    t: Array
    motions: dict[str, SimulatedMotion]
    force: Array | None = None  # (N, 3) [N] force of the tip on its surroundings, base frame


def simulate_log(scenario: Scenario, log: SimulatedLog) -> SimulatedRun:
    """Simulate one recording, in closed loop, or exactly on its trajectories; raises as `_in_closed_loop` does."""
    if scenario.arm:
        return _in_closed_loop(scenario, scenario.arm, log)
    t = np.arange(round(log.duration * scenario.rate)) / scenario.rate
    return SimulatedRun(t, {name: _joint_motion(scenario, log, name, t) for name in log.joints})


def _joint_motion(scenario: Scenario, log: SimulatedLog, name: str, t: Array) -> SimulatedMotion:
    """The effort of a joint that follows its trajectory exactly, by inverse dynamics.  Section 6.1"""
    simulated, move = scenario.joints[name], log.moves.get(name)
    if isinstance(move, Fourier):
        q, dq, ddq = motion(move, t)
    else:
        q, dq, ddq = log.position(name, t), np.zeros_like(t), np.zeros_like(t)
    tau_ext = sum((push.effort_at(t) for push in log.external.get(name, ())), np.zeros_like(t))
    tau = regressor(simulated.joint.terms, q, dq, ddq) @ np.array(simulated.theta) + tau_ext
    return SimulatedMotion(q, dq, tau, tau_ext)


def _in_closed_loop(scenario: Scenario, simulated_arm: SimulatedArm, log: SimulatedLog) -> SimulatedRun:
    """Simulate the arm from rest at its first reference, its lead unrecorded; raises BadScenario if it diverges."""
    chain, joints = scenario.robot.known_chain, scenario.robot.joints
    names = [joint.name for joint in joints]
    ticks = round(1 / (scenario.rate * simulated_arm.tick))
    skipped, samples = round(log.lead * scenario.rate), round(log.duration * scenario.rate)
    t = np.arange(-skipped, samples) / scenario.rate
    reference = np.column_stack([log.position(name, t) for name in names])
    stops = np.array([scenario.joints[name].stops for name in names])
    friction = simulated_arm.families[log.family].friction
    body = JointConstraints(friction, *np.ascontiguousarray(stops.T))
    plant = arm(chain, scenario.robot.known_bodies, simulated_arm.motors.gear_ratio**2 * simulated_arm.rotors)
    clock = Timing(simulated_arm.tick, ticks)
    instants = np.arange(len(t) * ticks, dtype=np.float64) * simulated_arm.tick - log.lead
    surroundings = _surroundings(log, chain, names, instants)
    drive = body, simulated_arm.motors, simulated_arm.control
    result = simulate(plant, *drive, clock, reference, surroundings, reference[0])
    if not all(np.isfinite(values).all() for values in result):
        remedy = "the control loop is unstable; lower its gains, or shorten arm.tick"
        raise BadScenario(f"{scenario.name}: log {log.name}: {remedy}")
    q, dq, tau, tau_ext, force = (values[skipped:] for values in result)
    motions = {
        name: SimulatedMotion(*(np.ascontiguousarray(values[:, i]) for values in (q, dq, tau, tau_ext)))
        for i, name in enumerate(names)
    }
    return SimulatedRun(t[skipped:], {name: motions[name] for name in log.joints}, force)


def _surroundings(log: SimulatedLog, chain: Chain, names: list[str], t: Array) -> Surroundings:
    """Collect the efforts and forces on the arm at the ticks t (T,) [s], the mass, and the tissue."""
    efforts, forces = np.zeros((len(t), len(names))), np.zeros((len(t), 3))
    for i, name in enumerate(names):
        for push in log.external.get(name, ()):
            efforts[:, i] += push.effort_at(t)
    for push in log.tip:
        forces += np.outer(push.effort_at(t), np.array(push.direction))
    surface, tissue = np.zeros(3), log.tissue
    if tissue:
        q = [tissue.surface if name in log.moves else log.held.get(name, 0.0) for name in names]
        surface = np.array(kinematics.tip(chain, q))
    stiffness, damping = (tissue.stiffness, tissue.damping) if tissue else (0.0, 0.0)
    at_tip = bool(log.tip) or tissue is not None
    return Surroundings(efforts, forces, log.mass, stiffness, damping, surface, UP.copy(), at_tip)


def theta(scenario: Scenario, family: str) -> dict[str, Array]:
    """The true parameters of each joint's model, which is exact while the other joints are at zero.

    Friction is taken from the scenario.  Inertia and gravity follow from the links, rounded to `SIGNIFICANT_DIGITS` so
    that every machine gives the same.  Joints with other friction than viscous and Coulomb friction are omitted.
    """
    simulated_arm = cast(SimulatedArm, scenario.arm)
    friction = simulated_arm.families[family].friction
    chain, bodies = scenario.robot.known_chain, scenario.robot.known_bodies
    drives = Drives(simulated_arm.motors.gear_ratio, simulated_arm.rotors, friction.viscous, friction.coulomb_up)
    parameters = {}
    for i, joint in enumerate(scenario.robot.joints):
        levels = {float(x[i]) for x in (friction.coulomb_up, friction.coulomb_down, friction.static_up,
                                        friction.static_down)}  # fmt: skip
        if len(levels) > 1 or friction.bristle_stiffness[i] > 0:
            continue
        values = reduced_parameters(chain, bodies, i, len(scenario.robot.joints), drives)
        names = [term.name for term in joint.terms]
        if all(abs(value) < NEGLIGIBLE for name, value in values.items() if name not in names):
            theta = [values.get(name, 0.0) for name in names]
            parameters[joint.name] = np.array([float(f"{value:.{SIGNIFICANT_DIGITS}g}") for value in theta])
    return parameters
