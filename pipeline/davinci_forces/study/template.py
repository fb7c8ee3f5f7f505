"""A first study.toml for logs, from the names and units of their channels."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces import robots
from davinci_forces.errors import BadRequest
from davinci_forces.logs import open_log
from davinci_forces.logs.joined import Joined
from davinci_forces.logs.log import Channel, Log
from davinci_forces.maths.units import SI, canonical, measures
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study.belonging import DEFAULT, Arm, arm_of, grouped, guess_joined, split
from davinci_forces.study.channels import OF_THE_LOG, is_tissue, tissue_channels, unit_of
from davinci_forces.study.guessing import (
    Holding,
    Meaning,
    Role,
    clock_hint,
    guess,
    has_clock,
    is_time,
    named_time,
    roles_of,
    samples_of,
)

# Words of a channel's name that tell what it holds, the telling ones first.
WORDS = {
    "i": ("current", "amp", "i"),
    "dq": ("velocity", "speed", "rate", "dq", "vel"),
    "tau": ("torque", "effort", "force", "tau"),
    "q": ("position", "angle", "pos", "q", "theta"),
}
IN_METRES = 0.5  # that a tip covers at most, or a push is deep: what covers more is in mm


class Draft(NamedTuple):
    """A study.toml that was drawn up, and the file of its robot where that has to be written, too."""

    text: str
    robot_file: str = ""
    robot_text: str = ""


@dataclass(frozen=True)
class Drawn:
    """One [[log]]: its files, opened, and what is guessed of it."""

    files: list[Path]
    log: Log
    guess: Holding

    @property
    def name(self) -> str:
        """The name of its first file, as a study may call a log."""
        first = self.files[0]
        name = split(first)[0] if len(self.files) > 1 else first.name.partition(".")[0]
        return re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_") or "log"


def describe(files: Sequence[Path], folder: Path, robot_name: str = "") -> Draft:
    """A study.toml that names every channel of every log and guesses what each holds; "" has the robot guessed, too.

    Raises
    ------
    BadRequest
        If a log lies outside the study's folder.
    BadLog, BadRobot
        If a log or the robot cannot be read.
    """
    for file in files:
        if not file.resolve().is_relative_to(folder.resolve()):
            raise BadRequest(f"{file} lies outside {folder}; a study holds its own logs: put it there first")
    if robot_name:
        robots.load(robot_name, folder)  # refused before logs are read
    known = robots.load(robot_name or DEFAULT, folder)
    drawn = _alike([_drawn(members, known) for members in grouped(files)])
    guesses = [each.guess for each in drawn]
    arm = Arm(robot_name, known, "") if robot_name else arm_of(guesses, folder)
    robot = arm.robot
    reason = f"; {arm.reason}" if arm.reason else ""
    head = [
        f"title = {_text(folder.resolve().name)}",
        f"robot = {_text(arm.name)}  # {robot.title}: joints {', '.join(j.name for j in robot.joints)}{reason}",
        "simulated = false",
        *([f"# tool = {{ length = {robot.tool.length} }}  # [m] of the shaft of the tool"] if robot.tool else []),
        "",
        "[settings]  # every key has a default; the report prints what was used",
        "# lowpass = 17.0  # [Hz] zero-phase, where velocities and accelerations are differences",
    ]
    if arm.name.endswith(".urdf") and any("i" in each.symbols() for each in guesses):
        head += _in_amperes(robot)
    roles = roles_of([each.name for each in drawn], guesses)
    logs = (line for each, role in zip(drawn, roles, strict=True) for line in _log(each, folder, robot, role))
    return Draft("\n".join([*head, *logs]) + "\n", arm.name if arm.text else "", arm.text)


def _in_amperes(robot: Robot) -> Iterator[str]:
    """Lines by which currents are the effort of joints whose drives a URDF says nothing of."""
    for joint in robot.joints:
        yield ""
        yield f"[robot_overrides.{joint.name}]"
        yield 'effort = "A"  # the log holds currents; where the constant is known, torque_constant = ... [N m/A]'


def _drawn(files: list[Path], robot: Robot) -> Drawn:
    if len(files) > 1:
        joined = Joined([open_log(file) for file in files])
        return Drawn(files, joined, guess_joined(joined))
    log = open_log(files[0])
    named = _names_joints(log, robot) or is_tissue([*_touching(log, robot).values()])
    return Drawn(files, log, Holding() if named else guess(log))


def _alike(drawn: list[Drawn]) -> list[Drawn]:
    """The same, where currents that one log tells to be such are currents in all logs of as many channels."""
    widths = {len(each.log.channels) for each in drawn if "i" in each.guess.symbols()}
    return [_as_currents(each) if len(each.log.channels) in widths else each for each in drawn]


def _as_currents(drawn: Drawn) -> Drawn:
    told = {
        name: replace(each, symbol="i", reason="CHECK: current, as in another log of as many channels")
        if each.symbol == "tau" else each
        for name, each in drawn.guess.told.items()
    }  # fmt: skip
    return replace(drawn, guess=replace(drawn.guess, told=told))


def _log(drawn: Drawn, folder: Path, robot: Robot, role: Role) -> Iterator[str]:
    log, found = drawn.log, drawn.guess
    touching = _touching(log, robot)
    tissue = not found.told and is_tissue([*touching.values()])
    paths = [_text(file.resolve().relative_to(folder.resolve()).as_posix()) for file in drawn.files]
    yield ""
    yield "[[log]]"
    yield f"name = {_text(drawn.name)}"
    yield f"file = {paths[0]}" if len(paths) == 1 else f"join = [{', '.join(paths)}]  # one signal a file"
    choices = "identification, validation, contact, weight, tissue or friction"
    if found.told:
        yield f'role = "{role.role}"  # {role.reason}; or {choices}'
        yield from role.more
    else:
        yield f'role = "{"tissue" if tissue else "identification"}"  # {choices}'
    if not tissue:
        yield "# period = 10.0  # [s] found from the data; a stated one is checked against them"
    yield from _rate(log, found, tissue)
    yield "# skip = 1.0  # [s] start-up transient to leave out"
    yield "# until = 60.0  # [s] where the log ends: what comes after, a stop for instance, is left out"
    if tissue:
        yield '# contact = "all"  # where every sample is of contact; else contact is found'
    else:
        yield "# contact = [[12.0, 14.5]]  # [s] known contact windows"
    yield "[log.channels]"
    yield from _channels(drawn, robot, touching if tissue else {})


def _rate(log: Log, found: Holding, tissue: bool) -> Iterator[str]:
    """The line of a log's rate, where nothing else is its clock."""
    if has_clock(log) or named_time(log) or found.time:
        return
    if found.rate:
        yield f"rate = {found.rate!r}  # [Hz] by which the velocities are those of the positions"
        return
    hint = "" if tissue else clock_hint(log)
    needs = "pushes need none, but for the damping of the tissue" if tissue else "CORRECT THIS"
    needs += f"; or {hint}" if hint else ""
    yield f"{'# ' if tissue else ''}rate = 100.0  # [Hz] the log carries no clock: {needs}"


def _touching(log: Log, robot: Robot) -> dict[str, str]:
    """Channels that tell of pushes into tissue, by name, where no channel is of a joint."""
    if _names_joints(log, robot):
        return {}
    return tissue_channels([channel for channel in log.channels if not is_time(channel)])


def _names_joints(log: Log, robot: Robot) -> bool:
    return any(_guess(channel, robot) not in ("", "time") for channel in log.channels)


def _channels(drawn: Drawn, robot: Robot, touching: dict[str, str]) -> Iterator[str]:
    log, found = drawn.log, drawn.guess
    taken: set[str] = set()
    own = named_time(log)
    if found.time.isdecimal():
        taken.add("time")
        yield f"time = {found.time}  # {found.why_time}"
    big = _in_millimetres(log, touching)
    for channel in log.channels:
        if channel.derived:
            continue
        if quantity := touching.get(channel.name):
            yield _touched(channel, quantity, channel.name in big)
            continue
        known = f"  # in {channel.unit}" if channel.unit else "  # the log gives no unit: SI is taken"
        if told := found.told.get(channel.name):
            yield _told(channel, told, found, robot)
            continue
        guessed = "time" if found.told and channel.name == own else "" if found.told else _guess(channel, robot)
        if channel.name == found.time and not own:
            guessed, known = "time", f"  # {found.why_time}"
        if guessed and guessed not in taken and channel.kind == "number":
            taken.add(guessed)
            clocked = guessed == "time" and log.clock is not None and not own
            yield (
                f"{'# ' if clocked else ''}{_text(guessed) if '.' in guessed else guessed} = {_text(channel.name)}"
                f"{'  # the log has a clock of its own' if clocked else known}"
            )
        else:
            yield f'# "<joint>.<quantity>" = {_text(channel.name)}{known}'
    yield "# quantities of a joint: q or theta_m, dq or dtheta_m, tau or i"
    yield "# of the log: time, and for tissue push, depth or tip_x, tip_y, tip_z, force or force_x, force_y, force_z"


def _told(channel: Channel, told: Meaning, found: Holding, robot: Robot) -> str:
    """The line of a channel that its number or content tells; commented out where the joint rests or is unknown."""
    if told.joint >= len(robot.joints):
        return f'# "<joint>.{told.symbol}" = {_text(channel.name)}  # joint {told.joint + 1}, which {robot.name} lacks'
    joint = robot.joints[told.joint]
    line = f"{_text(f'{joint.name}.{told.symbol}')} = {_text(channel.name)}"
    if found.moving and told.joint not in found.moving:
        return f"# {line}  # the joint is at rest"
    return f"{line}  # {told.reason}"


def _in_millimetres(log: Log, touching: dict[str, str]) -> set[str]:
    """Channels of lengths without a unit that cover more than any push does in metres."""
    names = [
        channel.name
        for channel in log.channels
        if OF_THE_LOG.get(touching.get(channel.name, "")) == "length" and not unit_of(channel, touching[channel.name])
    ]
    if not names or len(log.by_clock(names)) > 1:
        return set()
    samples = samples_of(log, names)
    return set(names) if max(float(np.ptp(values)) for values in samples.values() if len(values)) > IN_METRES else set()


def _touched(channel: Channel, quantity: str, in_millimetres: bool) -> str:
    if quantity == "push":
        return f"push = {_text(channel.name)}  # number of the push"
    unit = unit_of(channel, quantity)
    if in_millimetres:
        return f'{quantity} = {{ channel = {_text(channel.name)}, unit = "mm" }}  # by its size'
    where = "" if channel.unit else "  # by its name" if unit else "  # the log gives no unit: CHECK THIS"
    return (
        f"{quantity} = {{ channel = {_text(channel.name)}, unit = {_text(unit or SI[OF_THE_LOG[quantity]])} }}{where}"
    )


def _guess(channel: Channel, robot: Robot) -> str:
    if is_time(channel):
        return "time"
    words = re.findall(r"[a-z]+|\d+", channel.name.lower())
    joints = [joint for joint in robot.joints if _named(joint, words, channel.name)]
    symbol = next((s for s, telling in WORDS.items() if set(telling) & set(words)), "")
    if len(joints) != 1 or not symbol:
        return ""
    return f"{joints[0].name}.{_side(symbol, words, channel, joints[0])}"


def _side(symbol: str, words: Sequence[str], channel: Channel, joint: Joint) -> str:
    """The joint's or the motor's side, by the channel's name or by a unit that only one of them has."""
    unit = measures(canonical(channel.unit))
    motor = "motor" in words or (unit == "angle" and joint.unit("{position}") == "m")
    return {"q": "theta_m", "dq": "dtheta_m"}.get(symbol, symbol) if motor else symbol


def _named(joint: Joint, words: Sequence[str], name: str) -> bool:
    parts = joint.name.split("_")
    return joint.name in name.lower() or set(parts) <= set(words) or parts[-1] in words


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
