"""Draft a study.toml for logs, from the names and units of their channels."""

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
from davinci_forces.study.belonging import DEFAULT_ROBOT, Arm, arm_of, group_recordings, guess_joined, split_signal
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

# Words of a channel's name by symbol, the more specific first.
JOINT_WORDS = {
    "i": ("current", "amp", "i"),
    "dq": ("velocity", "speed", "rate", "dq", "vel"),
    "tau": ("torque", "effort", "force", "tau"),
    "q": ("position", "angle", "pos", "q", "theta"),
}
MAX_SPAN = 0.5  # [m] of a tip's path or a push's depth; values that span more are in mm


class Draft(NamedTuple):
    """The text of a study.toml, and the file of its robot where that has to be written, too."""

    text: str
    robot_file: str = ""
    robot_text: str = ""


@dataclass(frozen=True)
class DraftLog:
    """One [[log]]: its files, the opened log, and the guess of its channels."""

    files: list[Path]
    log: Log
    guess: Holding

    @property
    def name(self) -> str:
        """The name of its first file, as a valid name of a log."""
        first = self.files[0]
        name = split_signal(first)[0] if len(self.files) > 1 else first.name.partition(".")[0]
        return re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_") or "log"


def describe(files: Sequence[Path], folder: Path, robot_name: str = "") -> Draft:
    """Draft a study.toml that names every channel of every log and guesses its content; "" guesses the robot, too.

    Raises
    ------
    BadRequest
        If a log lies outside the study's folder.
    BadLog, BadRobot
        If a log or the robot cannot be read.
    """
    for file in files:
        if not file.resolve().is_relative_to(folder.resolve()):
            raise BadRequest(f"{file} lies outside {folder}; copy it there first, as a study holds its own logs")
    if robot_name:
        robots.load(robot_name, folder)  # refuses an invalid robot before logs are read
    robot = robots.load(robot_name or DEFAULT_ROBOT, folder)
    drawn = _same_currents([_draft_log(members, robot) for members in group_recordings(files)])
    guesses = [draft.guess for draft in drawn]
    arm = Arm(robot_name, robot, "") if robot_name else arm_of(guesses, folder)
    robot = arm.robot
    reason = f"; {arm.reason}" if arm.reason else ""
    head = [
        f"title = {_text(folder.resolve().name)}",
        f"robot = {_text(arm.name)}  # {robot.title}: joints {', '.join(j.name for j in robot.joints)}{reason}",
        "simulated = false",
        *([f"# tool = {{ length = {robot.tool.length} }}  # [m] length of the tool's shaft"] if robot.tool else []),
        "",
        "[settings]  # every key has a default; the report lists the values used",
        "# lowpass = 17.0  # [Hz] zero-phase low-pass of differentiated velocities and accelerations",
    ]
    if arm.name.endswith(".urdf") and any("i" in draft.symbols() for draft in guesses):
        head += _in_amperes(robot)
    roles = roles_of([draft.name for draft in drawn], guesses)
    logs = (line for draft, role in zip(drawn, roles, strict=True) for line in _log(draft, folder, robot, role))
    return Draft("\n".join([*head, *logs]) + "\n", arm.name if arm.text else "", arm.text)


def _in_amperes(robot: Robot) -> Iterator[str]:
    """Lines that make currents the effort of joints, as a URDF has no torque constants."""
    for joint in robot.joints:
        yield ""
        yield f"[robot_overrides.{joint.name}]"
        yield 'effort = "A"  # the log holds currents; if the constant is known, torque_constant = ... [N m/A]'


def _draft_log(files: list[Path], robot: Robot) -> DraftLog:
    if len(files) > 1:
        joined = Joined([open_log(file) for file in files])
        return DraftLog(files, joined, guess_joined(joined))
    log = open_log(files[0])
    named = _names_joints(log, robot) or is_tissue([*_touching(log, robot).values()])
    return DraftLog(files, log, Holding() if named else guess(log))


def _same_currents(drawn: list[DraftLog]) -> list[DraftLog]:
    """Take efforts as currents in all logs with as many channels as one that holds currents."""
    widths = {len(draft.log.channels) for draft in drawn if "i" in draft.guess.symbols()}
    return [_as_currents(draft) if len(draft.log.channels) in widths else draft for draft in drawn]


def _as_currents(drawn: DraftLog) -> DraftLog:
    meanings = {
        name: replace(meaning, symbol="i", reason="CHECK: current, as in another log of as many channels")
        if meaning.symbol == "tau" else meaning
        for name, meaning in drawn.guess.meanings.items()
    }  # fmt: skip
    return replace(drawn, guess=replace(drawn.guess, meanings=meanings))


def _log(drawn: DraftLog, folder: Path, robot: Robot, role: Role) -> Iterator[str]:
    log, holding = drawn.log, drawn.guess
    touching = _touching(log, robot)
    tissue = not holding.meanings and is_tissue([*touching.values()])
    paths = [_text(file.resolve().relative_to(folder.resolve()).as_posix()) for file in drawn.files]
    yield ""
    yield "[[log]]"
    yield f"name = {_text(drawn.name)}"
    yield f"file = {paths[0]}" if len(paths) == 1 else f"join = [{', '.join(paths)}]  # one signal per file"
    choices = "identification, validation, contact, weight, tissue or friction"
    if holding.meanings:
        yield f'role = "{role.role}"  # {role.reason}; or {choices}'
        yield from role.more
    else:
        yield f'role = "{"tissue" if tissue else "identification"}"  # {choices}'
    if not tissue:
        yield "# period = 10.0  # [s] estimated from the data; a given value is checked against them"
    yield from _rate(log, holding, tissue)
    yield "# skip = 1.0  # [s] start-up transient to leave out"
    yield "# until = 60.0  # [s] end of the log: later samples, a stop for instance, are left out"
    if tissue:
        yield '# contact = "all"  # if every sample is in contact; otherwise contact is detected'
    else:
        yield "# contact = [[12.0, 14.5]]  # [s] known contact windows"
    yield "[log.channels]"
    yield from _channels(drawn, robot, touching if tissue else {})


def _rate(log: Log, holding: Holding, tissue: bool) -> Iterator[str]:
    """The line of a log's rate, if the log has no other clock."""
    if has_clock(log) or named_time(log) or holding.time:
        return
    if holding.rate:
        yield f"rate = {holding.rate!r}  # [Hz] at which the velocities match the derivatives of the positions"
        return
    hint = "" if tissue else clock_hint(log)
    needs = "only the damping of the tissue needs it" if tissue else "CORRECT THIS"
    needs += f"; or {hint}" if hint else ""
    yield f"{'# ' if tissue else ''}rate = 100.0  # [Hz] the log has no clock: {needs}"


def _touching(log: Log, robot: Robot) -> dict[str, str]:
    """Quantities of pushes into tissue by channel name, where no channel is of a joint."""
    if _names_joints(log, robot):
        return {}
    return tissue_channels([channel for channel in log.channels if not is_time(channel)])


def _names_joints(log: Log, robot: Robot) -> bool:
    return any(_guess(channel, robot) not in ("", "time") for channel in log.channels)


def _channels(drawn: DraftLog, robot: Robot, touching: dict[str, str]) -> Iterator[str]:
    log, holding = drawn.log, drawn.guess
    taken: set[str] = set()
    time_channel = named_time(log)
    if holding.time.isdecimal():
        taken.add("time")
        yield f"time = {holding.time}  # {holding.why_time}"
    big = _in_millimetres(log, touching)
    for channel in log.channels:
        if channel.derived:
            continue
        if quantity := touching.get(channel.name):
            yield _touch_line(channel, quantity, channel.name in big)
            continue
        unit_note = f"  # in {channel.unit}" if channel.unit else "  # the log gives no unit: SI is assumed"
        if meaning := holding.meanings.get(channel.name):
            yield _meaning_line(channel, meaning, holding, robot)
            continue
        guessed = (
            "time"
            if holding.meanings and channel.name == time_channel
            else ""
            if holding.meanings
            else _guess(channel, robot)
        )
        if channel.name == holding.time and not time_channel:
            guessed, unit_note = "time", f"  # {holding.why_time}"
        if guessed and guessed not in taken and channel.kind == "number":
            taken.add(guessed)
            clocked = guessed == "time" and log.clock is not None and not time_channel
            yield (
                f"{'# ' if clocked else ''}{_text(guessed) if '.' in guessed else guessed} = {_text(channel.name)}"
                f"{'  # the log has its own clock' if clocked else unit_note}"
            )
        else:
            yield f'# "<joint>.<quantity>" = {_text(channel.name)}{unit_note}'
    yield "# quantities of a joint: q or theta_m, dq or dtheta_m, tau or i"
    yield "# of the log: time; for tissue also push, depth or tip_x, tip_y, tip_z, force or force_x, force_y, force_z"


def _meaning_line(channel: Channel, meaning: Meaning, holding: Holding, robot: Robot) -> str:
    """The line of a channel that was guessed; commented out where the joint does not move or is unknown."""
    if meaning.joint >= len(robot.joints):
        count = f"joint {meaning.joint + 1}, but {robot.name} has {len(robot.joints)}"
        return f'# "<joint>.{meaning.symbol}" = {_text(channel.name)}  # {count}'
    joint = robot.joints[meaning.joint]
    line = f"{_text(f'{joint.name}.{meaning.symbol}')} = {_text(channel.name)}"
    if holding.moving and meaning.joint not in holding.moving:
        return f"# {line}  # the joint does not move"
    return f"{line}  # {meaning.reason}"


def _in_millimetres(log: Log, touching: dict[str, str]) -> set[str]:
    """Channels of lengths without a unit whose values span more than any push in metres."""
    names = [
        channel.name
        for channel in log.channels
        if OF_THE_LOG.get(touching.get(channel.name, "")) == "length" and not unit_of(channel, touching[channel.name])
    ]
    if not names or len(log.by_clock(names)) > 1:
        return set()
    samples = samples_of(log, names)
    return set(names) if max(float(np.ptp(values)) for values in samples.values() if len(values)) > MAX_SPAN else set()


def _touch_line(channel: Channel, quantity: str, in_millimetres: bool) -> str:
    if quantity == "push":
        return f"push = {_text(channel.name)}  # number of the push"
    unit = unit_of(channel, quantity)
    if in_millimetres:
        return f'{quantity} = {{ channel = {_text(channel.name)}, unit = "mm" }}  # unit by the size of its values'
    where = "" if channel.unit else "  # unit by its name" if unit else "  # the log gives no unit: CHECK THIS"
    return (
        f"{quantity} = {{ channel = {_text(channel.name)}, unit = {_text(unit or SI[OF_THE_LOG[quantity]])} }}{where}"
    )


def _guess(channel: Channel, robot: Robot) -> str:
    if is_time(channel):
        return "time"
    words = re.findall(r"[a-z]+|\d+", channel.name.lower())
    joints = [joint for joint in robot.joints if _named(joint, words, channel.name)]
    symbol = next((s for s, telling in JOINT_WORDS.items() if set(telling) & set(words)), "")
    if len(joints) != 1 or not symbol:
        return ""
    return f"{joints[0].name}.{_side(symbol, words, channel, joints[0])}"


def _side(symbol: str, words: Sequence[str], channel: Channel, joint: Joint) -> str:
    """The symbol on the joint's or the motor's side, by the channel's name or by a unit that only one side has."""
    unit = measures(canonical(channel.unit))
    motor = "motor" in words or (unit == "angle" and joint.unit("{position}") == "m")
    return {"q": "theta_m", "dq": "dtheta_m"}.get(symbol, symbol) if motor else symbol


def _named(joint: Joint, words: Sequence[str], name: str) -> bool:
    parts = joint.name.split("_")
    return joint.name in name.lower() or set(parts) <= set(words) or parts[-1] in words


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
