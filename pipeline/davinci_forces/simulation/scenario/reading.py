"""Reading a scenario from TOML, and saying everything that is wrong with it at once, each with its line."""

import math
import re
from importlib.resources import files
from pathlib import Path as File

from davinci_forces import robots, toml
from davinci_forces.errors import BadRobot
from davinci_forces.robots.robot import Robot
from davinci_forces.simulation.scenario.arm import arm_of, noise_of
from davinci_forces.simulation.scenario.logs import logs_of
from davinci_forces.simulation.scenario.scenario import BadScenario, Scenario, SensorNoise, SimulatedJoint
from davinci_forces.toml import TomlTable

LONGEST = 10_000_000  # samples of a log


def shipped() -> tuple[str, ...]:
    """The names of the scenarios that come with the package."""
    names = (entry.name for entry in files("davinci_forces.simulation").joinpath("shipped").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load(scenario: str) -> Scenario:
    """Read a scenario: a shipped one by its name, or a file by its path.

    Raises
    ------
    BadScenario
        If there is none, or with every problem that it has, one a line.
    """
    if scenario in shipped():
        text = files("davinci_forces.simulation").joinpath("shipped", f"{scenario}.toml").read_text(encoding="utf-8")
        table = toml.parse(text, scenario, BadScenario)
    elif File(scenario).is_file():
        table = toml.read(File(scenario), BadScenario)
    else:
        raise BadScenario(f"there is no scenario {scenario!r}; there are {', '.join(shipped())}, or name a .toml file")
    made = _scenario(File(scenario).stem, table)
    table.file.refuse(BadScenario)
    return made


def _scenario(name: str, table: TomlTable) -> Scenario:
    robot = _robot(table)
    whole = "arm" in table
    joints = {key: _joint(robot, key, entry, whole) for key, entry in table.table("joint").each()}
    if not joints:
        table.problem("it has no [joint.<name>] table, so nothing can move")
    arm = arm_of(table, robot, joints) if whole else None
    rate = table.number("rate", above=0.0)
    turn = 1 / rate / arm.tick if arm else 1.0  # in ticks; NaN where a problem is noted already
    if math.isfinite(turn) and abs(turn - round(turn)) > 1e-6:
        table.problem(
            f"a turn of the controller at {rate:g} Hz must be whole ticks, not {turn:g} of them", "arm", "tick"
        )
    logs = logs_of(table, joints, tuple(arm.families) if arm else ())
    for log in logs:
        samples = (log.lead + log.duration) * rate
        if math.isfinite(samples) and not 2 <= samples <= LONGEST:
            table.problem(
                f"log {log.name}: {samples:.3g} samples cannot be recorded; it must be 2 to {LONGEST}", "rate"
            )
    title, seed, started = table.text("title", name), table.whole("seed"), table.text("started")
    if started and not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", started):
        table.problem(f"started must be a date and time such as '2016-05-02T09:00:00', not {started!r}", "started")
    table.close()
    return Scenario(name, title, robot, seed, rate, started, joints, logs, arm)


def _robot(table: TomlTable) -> Robot:
    name = table.text("robot", choices=robots.ROBOTS)
    return robots.load(name if name in robots.ROBOTS else "davinci", File())  # noted as a problem; read on with one


def _joint(robot: Robot, name: str, table: TomlTable, whole: bool) -> SimulatedJoint:
    try:
        joint = robot.joint(name)
    except BadRobot as error:
        table.problem(str(error))
        joint = robot.joints[0]
    noise, theta = SensorNoise(), tuple[float, ...]()
    if not whole:
        noise = noise_of(table)
        values = table.table("theta")
        theta = tuple(values.number(term.name) for term in joint.terms)
        values.close()
    label = table.text("label", joint.title)
    encoder, current = table.number("encoder_step", 0.0, low=0.0), table.number("current_step", 0.0, low=0.0)
    low, high = table.numbers("stops", [-1e9, 1e9], count=2) or (-math.inf, math.inf)
    if low >= high:
        table.problem(f"stops must be lower and upper, not {low:g} and {high:g}", "stops")
    table.close()
    return SimulatedJoint(joint, label, encoder, current, (low, high), noise, theta)
