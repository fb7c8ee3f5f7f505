"""Read scenarios from TOML; all problems of a file are reported together, each with its line."""

import math
import re
from importlib.resources import files
from pathlib import Path as File

import numpy as np

from davinci_forces import robots, toml
from davinci_forces.errors import BadRobot
from davinci_forces.haptics.scenario import read_friction, read_stops
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.simulation.actuators import Cascade, Motors, Regulator
from davinci_forces.maths.simulation.step import Friction
from davinci_forces.robots.robot import Robot
from davinci_forces.simulation.scenario import BadScenario, Family, Scenario, SensorNoise, SimulatedArm, SimulatedJoint
from davinci_forces.simulation.scenario.logs import logs_of
from davinci_forces.toml import TomlTable

MAX_SAMPLES = 10_000_000  # samples in a log


def shipped_scenarios() -> tuple[str, ...]:
    """The names of the scenarios that come with the package."""
    names = (entry.name for entry in files("davinci_forces.simulation").joinpath("shipped").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load(scenario: str) -> Scenario:
    """Read a scenario, shipped by its name, or by its path; raises BadScenario with all of its problems, one a line."""
    if scenario in shipped_scenarios():
        text = files("davinci_forces.simulation").joinpath("shipped", f"{scenario}.toml").read_text(encoding="utf-8")
        table = toml.parse(text, scenario, BadScenario)
    elif File(scenario).exists():
        table = toml.read(File(scenario), BadScenario)
    else:
        raise BadScenario(f"no scenario {scenario!r}; name one of {', '.join(shipped_scenarios())}, or a .toml file")
    result = _scenario(File(scenario).stem, table)
    table.file.refuse(BadScenario)
    return result


def _scenario(name: str, table: TomlTable) -> Scenario:
    robot = _robot(table)
    whole_arm = "arm" in table
    joints = {key: _joint(robot, key, entry, whole_arm) for key, entry in table.table("joint").subtables()}
    if not joints:
        table.problem("it has no [joint.<name>] table, so nothing can move")
    arm = arm_of(table, robot, joints) if whole_arm else None
    rate = table.number("rate", above=0.0)
    period = 1 / rate / arm.tick if arm else 1.0  # in ticks; NaN if a problem is already noted
    if math.isfinite(period) and abs(period - round(period)) > 1e-6:
        message = f"the controller's period at {rate:g} Hz must be a whole number of ticks, not {period:g}"
        table.problem(message, "arm", "tick")
    jitter, harmonics = table.number("clock_jitter", 0.0, low=0.0), table.whole("harmonics", 0)
    logs = logs_of(table, joints, tuple(arm.families) if arm else ())
    for log in logs:
        samples = (log.lead + log.duration) * rate
        if math.isfinite(samples) and not 2 <= samples <= MAX_SAMPLES:
            table.problem(f"log {log.name} has {samples:.3g} samples; it must have 2 to {MAX_SAMPLES}", "rate")
    title, seed, started = table.text("title", name), table.whole("seed"), table.text("started")
    if started and not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", started):
        table.problem(f"started must be a date and time such as '2016-05-02T09:00:00', not {started!r}", "started")
    table.close_all()
    return Scenario(name, title, robot, seed, rate, started, joints, logs, arm, jitter, harmonics)


def _robot(table: TomlTable) -> Robot:
    name = table.text("robot", choices=robots.ROBOTS)
    # A wrong name is noted, and the file read to its end with another robot.
    return robots.load(name if name in robots.ROBOTS else "davinci", File())


def _joint(robot: Robot, name: str, table: TomlTable, whole_arm: bool) -> SimulatedJoint:
    try:
        joint = robot.joint(name)
    except BadRobot as error:
        table.problem(str(error))
        joint = robot.joints[0]
    noise, theta = SensorNoise(), tuple[float, ...]()
    if not whole_arm:
        noise = noise_of(table)
        values = table.table("theta")
        theta = tuple(values.number(term.name) for term in joint.terms)
    label = table.text("label", joint.title)
    encoder, current = table.number("encoder_step", 0.0, low=0.0), table.number("current_step", 0.0, low=0.0)
    return SimulatedJoint(joint, label, encoder, current, read_stops(table, (-1e9, 1e9)), noise, theta)


def arm_of(table: TomlTable, robot: Robot, joints: dict[str, SimulatedJoint]) -> SimulatedArm:
    """Read [arm], [arm.control] and the families.  Every list has one number for each joint."""
    if robot.chain is None or robot.bodies is None:
        table.problem(f"{robot.name} has no geometry or no masses, so the whole arm cannot be simulated", "arm")
    if list(joints) != [joint.name for joint in robot.joints]:
        needed = ", ".join(joint.name for joint in robot.joints)
        table.problem(f"the whole arm needs [joint.<name>] of {needed}, in that order", "joint")
    arm, n = table.table("arm"), len(robot.joints)
    tick = arm.number("tick", above=0.0)
    rotors = _list(arm, "rotor_inertia", n)
    motors = Motors(
        gear_ratio=np.array([joint.gear_ratio for joint in robot.joints]),
        torque_constant=np.array([joint.torque_constant for joint in robot.joints]),
        encoder_step=np.array([joints[j.name].encoder_step if j.name in joints else 0.0 for j in robot.joints]),
        **{key: _list(arm, key, n, True) for key in ("resistance", "inductance", "current_limit", "voltage_limit")},
    )
    control = _control(arm.table("control"), n)
    families = {name: _family(entry, robot) for name, entry in table.table("family").subtables()}
    if not families:
        table.problem("it has no [family.<name>], which states the friction and noise of the arm")
    return SimulatedArm(tick, rotors, motors, control, families)


def _control(table: TomlTable, n: int) -> Cascade | Regulator:
    """Read the control law: the laboratory's cascade, PID with gravity compensation (chapter 5), or none (Fig 4.5)."""
    name = table.text("law", "cascade", ("cascade", "pid", "none"))
    if name == "none":
        return Regulator(np.zeros(n), np.zeros(n), np.zeros(n), 0.0)
    if name == "pid":
        K_p, K_d, K_i = (_list(table, key, n) for key in ("proportional", "derivative", "integral"))
        return Regulator(K_p, K_d, K_i, table.number("gravity", 1.0, low=0.0))
    return Cascade(*(_list(table, key, n) for key in Cascade._fields))


def _list(table: TomlTable, key: str, n: int, positive: bool = False) -> Array:
    values, sign = table.numbers(key, count=n), "be greater than 0" if positive else "not be negative"
    if any(value < 0 or (positive and value == 0) for value in values):
        table.problem(f"{key} must {sign}, but is {list(values)}", key)
    return np.array(values if len(values) == n else [1.0] * n)


def _family(table: TomlTable, robot: Robot) -> Family:
    rows, noise = [], {}
    for joint in robot.joints:
        entry = table.table(joint.name)
        viscous, coulomb, static, *stribeck_and_bristles = read_friction(entry)
        rows.append((viscous, *coulomb, *static, *stribeck_and_bristles))
        noise[joint.name] = noise_of(entry)
    return Family(Friction(*(np.array(column) for column in zip(*rows, strict=True))), noise)


def noise_of(table: TomlTable) -> SensorNoise:
    """Read the noise of one joint."""
    values = table.table("noise")
    sizes = {key: values.number(key, 0.0, low=0.0) for key in ("q", "dq", "tau", "drift")}
    return SensorNoise(**sizes, correlation=values.number("correlation", 1.0, above=0.0))
