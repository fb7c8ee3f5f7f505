"""Draft a study.toml for logs, from the names, units and values of their channels."""

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces import robots
from davinci_forces.errors import BadLog, BadRequest
from davinci_forces.logs import BAG, open_log
from davinci_forces.logs.joined import Joined
from davinci_forces.logs.log import Channel, Log
from davinci_forces.maths.tissue.palpation import touches_at_once
from davinci_forces.maths.units import SI, canonical, measures
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import belonging
from davinci_forces.study.belonging import Arm
from davinci_forces.study.channels import OF_THE_LOG, force_sensor, is_tissue, kind_of_unit, tissue_channels, unit_of
from davinci_forces.study.entries import ROLES, is_inside
from davinci_forces.study.guessing import Holding, Meaning, guess
from davinci_forces.study.names import is_time, stated_unit, symbol_of, words_of
from davinci_forces.study.roles import Evidence, Role, roles_of
from davinci_forces.study.timing import samples_of

# Of joints: two units, and the farthest that a drive goes in both; beyond the second, a position is in counts.
UNKNOWN_UNITS = {
    Kind.REVOLUTE: ("rad", "deg", belonging.MAX_ANGLE_DRIVE, 3600.0),
    Kind.PRISMATIC: ("m", "mm", 2.0, 2000.0),
}
MAX_SPAN = 0.5  # [m] of a tip's path or a push's depth; values that span more are in mm
NO_LOGS = {".toml", ".urdf", ".xacro", ".md", ".json", ".pdf", ".html", ".png", ".jpg", ".py", ".m", ".tdms_index"}


class Row(NamedTuple):
    """One log in the table that `new` ends with."""

    file: str
    role: str
    rate: str
    joints: str
    look_at: str


class Draft(NamedTuple):
    """The text of a study.toml, its robot, whose file may have to be written, too, a row for each log, and a remark."""

    text: str
    arm: Arm
    rows: tuple[Row, ...]
    remark: str


@dataclass(frozen=True)
class DraftLog:
    """One [[log]]: its files, the opened log, the guess of its channels, and the quantities of its pushes by channel.

    Beside joints, the quantities are those of a force sensor, in `sensor`.
    """

    files: list[Path]
    log: Log
    guess: Holding
    touching: dict[str, str]
    sensor: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name of its first file, as a valid name of a log."""
        first = self.files[0]
        name = belonging.split_signal(first)[0] if len(self.files) > 1 else first.name.partition(".")[0]
        return re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_") or "log"


def is_folder(path: Path) -> bool:
    """Whether a path is a folder of logs; a ROS 2 bag is a folder, too, but one log."""
    return path.is_dir() and not any(any(path.glob(pattern)) for pattern in BAG)


def logs_in(paths: Sequence[Path]) -> list[Path]:
    """The files of folders, and of their folders, besides descriptions and documents; other paths as they are."""
    files: list[Path] = []
    for path in paths:
        if is_folder(path):
            inside = [file for file in sorted(path.iterdir()) if not file.name.startswith(".")]
            files += logs_in([file for file in inside if file.suffix.lower() not in NO_LOGS])
        else:
            files.append(path)
    return files


def describe(files: Sequence[Path], folder: Path, robot_name: str = "") -> Draft:
    """Draft a study.toml that names every channel of every log and guesses its content; "" guesses the robot, too.

    Raises BadRequest if a log or the robot's file lies outside the study's folder, or there is no log.  Raises BadRobot
    if the robot cannot be read, and BadLog with the reason for each log if none can be read.
    """
    for file in files:
        if not file.resolve().is_relative_to(folder.resolve()):
            raise BadRequest(f"{file} lies outside {folder}; copy it there first, as a study holds its own logs")
    if not files:
        raise BadRequest(f"{folder} holds no logs")
    if robot_name.endswith(robots.FILES):
        if Path(robot_name).is_file():  # named from the current folder
            with suppress(ValueError):
                robot_name = Path(robot_name).absolute().relative_to(folder.absolute()).as_posix()
        if not (is_inside(robot_name) and (folder / robot_name).exists()):
            raise BadRequest(
                f"--robot {robot_name}: copy that file into {folder}, beside study.toml, and give its name there"
            )
    stated = [Arm(robot_name, robots.load(robot_name, folder), "")] if robot_name else []
    arms, why_not = (stated, []) if stated else belonging.candidates(folder)
    drawn, refused = _read(belonging.group_recordings(files), [arm.robot for arm in arms])
    if not drawn:
        what = "no log can be read, so no study is written; do what each line says, or name other files"
        raise BadLog("\n".join([*refused.values(), what]))
    drawn = _same_currents(drawn)
    texts = [draft.files[0].resolve().relative_to(folder.resolve()).as_posix() for draft in drawn]
    guesses = belonging.with_joints_of_files([draft.guess for draft in drawn], texts, arms)
    drawn = [replace(draft, guess=holding) for draft, holding in zip(drawn, guesses, strict=True)]
    channels = [channel.alias or channel.name for draft in drawn for channel in draft.log.channels]
    names = [folder.resolve().name, *(file.name for file in files), *channels]
    arm = stated[0] if stated else belonging.arm_of([draft.guess for draft in drawn], folder, names, arms, why_not)
    drawn = _named_as(arm.robot, drawn)
    named = [*_distinct(drawn)]
    roles = roles_of([_recording(draft, name, folder, arm.robot) for draft, name in named])
    blocks, rows = [], []
    for (draft, name), role in zip(named, roles, strict=True):
        tare = "" if role.tare is None else named[role.tare][1]
        writer = _Writer(draft, name, folder, arm.robot, role, tare)
        blocks += writer.lines()
        rows.append(writer.row())
    for file, why in refused.items():
        blocks += ["", f"# {_path([file], folder)[0]}: left out: {why}"]
        rows.append(Row(_path([file], folder)[0], "-", "-", "-", f"left out: {why}"))
    text = "\n".join([*_head(arm, folder, drawn), *blocks]) + "\n"
    by_current = [] if arm.name.endswith(".urdf") else _joints_by_current(arm.robot, drawn)  # a URDF states no drives
    assumed = [joint.name for joint in by_current if not joint.effort]
    drives = f"[robot_overrides] of study.toml, where those of {arm.name} are"
    remark = f"check gear_ratio and torque_constant of {', '.join(assumed)} in {drives}" if assumed else ""
    return Draft(text, arm, tuple(rows), remark)


def _read(groups: Sequence[list[Path]], listed: Sequence[Robot]) -> tuple[list[DraftLog], dict[Path, str]]:
    """Open recordings and guess their content; the reasons of those that cannot be read, by file."""
    drawn: list[DraftLog] = []
    refused: dict[Path, str] = {}
    for members in groups:
        try:
            drawn.append(_draft_log(members, listed))
        except (BadLog, OSError) as why:
            refused[members[0]] = str(why)
    return drawn, refused


def _draft_log(files: list[Path], listed: Sequence[Robot]) -> DraftLog:
    if len(files) > 1:
        joined = Joined([open_log(file) for file in files])
        return DraftLog(files, joined, belonging.guess_joined(joined), {})
    log = open_log(files[0])
    holding = guess(log, listed)
    touching = tissue_channels([channel for channel in log.channels if not is_time(channel)])
    touching = {name: quantity for name, quantity in touching.items() if name not in holding.meanings}
    if holding.meanings:
        return DraftLog(files, log, holding, {}, force_sensor(touching))
    return DraftLog(files, log, holding, touching if is_tissue([*touching.values()]) else {})


def _recording(draft: DraftLog, name: str, folder: Path, robot: Robot) -> Evidence:
    path = draft.files[0].resolve().relative_to(folder.resolve())
    moving = [robot.joints[k].kind for k in draft.guess.moving if k < len(robot.joints)]
    text = (path.parent / draft.files[0].name.partition(".")[0]).as_posix()
    return Evidence(name, text, draft.guess, bool(draft.touching), Kind.PRISMATIC in moving)


def _distinct(drawn: Sequence[DraftLog]) -> Iterator[tuple[DraftLog, str]]:
    """Each log with a name of its own: logs of one name get their folder's, or a number."""
    used: set[str] = set()
    for draft in drawn:
        name, number = draft.name, 1
        if name in used:
            name = f"{re.sub(r'[^a-z0-9_-]+', '-', draft.files[0].parent.name.lower()).strip('-_')}-{name}".strip("-")
        while name in used:
            number += 1
            name = f"{draft.name}-{number}"
        used.add(name)
        yield draft, name


def _named_as(robot: Robot, drawn: Sequence[DraftLog]) -> list[DraftLog]:
    """Assign channels to the robot's joints of the same names as their labels, in whatever order the log has them."""
    joints = {joint.name: k for k, joint in enumerate(robot.joints)}
    return [
        replace(draft, guess=draft.guess.with_joints([joints[label] for label in draft.guess.labels]))
        if draft.guess.labels and set(draft.guess.labels) <= joints.keys() else draft
        for draft in drawn
    ]  # fmt: skip


def _head(arm: Arm, folder: Path, drawn: Sequence[DraftLog]) -> Iterator[str]:
    robot = arm.robot
    reason = f"; {arm.reason}" if arm.reason else ""
    yield f"title = {_text(folder.resolve().name)}"
    yield f"robot = {_text(arm.name)}  # {robot.title}: joints {', '.join(j.name for j in robot.joints)}{reason}"
    yield "simulated = false"
    if robot.tool:
        yield f"# tool = {{ length = {robot.tool.length} }}  # [m] length of the tool's shaft"
    yield ""
    yield "[settings]  # every key has a default; the report lists the values used"
    yield "# harmonics = 0  # to keep in the position of a periodic motion; 0 keeps those that it has"
    yield "# delay = 0.1  # [s] by which the filter may show a push late; a longer delay lowers its noise"
    yield "# lowpass = 17.0  # [Hz] zero-phase low-pass of differentiated velocities and accelerations"
    for joint in _joints_by_current(robot, drawn):
        if arm.name.endswith(".urdf"):
            yield from ("", f"[robot_overrides.{joint.name}]")
            yield 'effort = "A"  # a current; if the drive is known, write torque_constant and gear_ratio in its place'
        elif not joint.effort:
            yield from (
                "",
                f"# [robot_overrides.{joint.name}]  # its current becomes an effort by these; CHECK your drive",
            )
            yield from (
                f"# gear_ratio = {joint.gear_ratio!r}  # [{'rad/m' if joint.kind is Kind.PRISMATIC else 'rad/rad'}]",
                f"# torque_constant = {joint.torque_constant!r}  # [N m/A]; efforts scale with both; a mass tests them",
            )


def _joints_by_current(robot: Robot, drawn: Sequence[DraftLog]) -> list[Joint]:
    """The joints whose effort is known by the current of their motor."""
    by_current = {m.joint for draft in drawn for m in draft.guess.meanings.values() if m.symbol == "i"}
    return [joint for k, joint in enumerate(robot.joints) if k in by_current]


def _same_currents(drawn: list[DraftLog]) -> list[DraftLog]:
    """Take efforts as currents in all logs without names that have as many channels as one that holds currents."""
    widths = {len(d.log.channels) for d in drawn if "i" in d.guess.symbols()}
    reason = "CHECK: current, as in another log of as many channels"
    for i, draft in enumerate(drawn):
        meanings = draft.guess.meanings if len(draft.log.channels) in widths else {}
        unclear = {n: m for n, m in meanings.items() if m.symbol == "tau" and m.reason.startswith("CHECK")}
        currents = {name: replace(meaning, symbol="i", reason=reason) for name, meaning in unclear.items()}
        drawn[i] = replace(draft, guess=replace(draft.guess, meanings=draft.guess.meanings | currents))
    return drawn


@dataclass(frozen=True)
class _Writer:
    """Writes the [[log]] of one recording, and its row of the table."""

    draft: DraftLog
    name: str
    folder: Path
    robot: Robot
    role: Role
    tare: str

    @property
    def is_empty(self) -> bool:
        """Whether nothing in it can be used, so that it is written commented out."""
        return not self.draft.guess.meanings and not self.draft.touching

    def lines(self) -> list[str]:
        """The lines of the [[log]]; all of them comments if nothing in the log can be used."""
        paths = [_text(path) for path in _path(self.draft.files, self.folder)]
        join = f"join = [{', '.join(paths)}]  # one signal per file"
        period = "# period = 10.0  # [s] estimated from the data; a given value is checked"
        block = [
            "[[log]]",
            f"name = {_text(self.name)}",
            f"file = {paths[0]}" if len(paths) == 1 else join,
            *self._role(),
            *([] if self.draft.touching else [period]),
            *self._rate(),
            "# skip = 1.0  # [s] start-up transient to leave out",
            "# until = 60.0  # [s] end of the log: later samples, a stop for instance, are left out",
            self._contact(),
            "[log.channels]",
            *self._channels(),
            "# quantities of a joint: q or theta_m, dq or dtheta_m, tau or i",
            "# of the log: time; of tissue also push, depth or tip_x, tip_y, tip_z, force or force_x, force_y, force_z",
        ]
        if not self.is_empty:
            return ["", *block]
        return ["", f"# {self.name}: left out: {self.why_empty}", *(f"# {line.removeprefix('# ')}" for line in block)]

    @property
    def why_empty(self) -> str:
        """Why nothing in the log can be used."""
        names = [channel.name for channel in self.draft.log.channels if not channel.derived]
        some = ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")
        return f"no position and effort of a joint, and no depth and force, among {some}"

    def row(self) -> Row:
        """The log in the table: its role, its rate, its joints, and what to look at first."""
        timing, holding = self.draft.guess.timing, self.draft.guess
        rate = f"{1 / timing.step:.5g} Hz" if timing.step else "missing" if timing.missing else "-"
        joints = [self.robot.joints[k].name for k in holding.moving if k < len(self.robot.joints)]
        look = [self.why_empty] if self.is_empty else [*self._doubts(), self.role.reason]
        role = "left out" if self.is_empty else self.role.role or "missing"
        file = ", ".join(_path(self.draft.files[:1], self.folder)) + (" ..." if len(self.draft.files) > 1 else "")
        return Row(file, role, rate, ", ".join(joints) or "-", "; ".join(filter(None, look)))

    def _doubts(self) -> Iterator[str]:
        timing = self.draft.guess.timing
        if not self.draft.touching:
            yield timing.missing and f"rate: {timing.missing}"
        yield timing.remark
        yield from (f"unit of {name}" for name in self._unknown_units())
        joints, holding = self.robot.joints, self.draft.guess
        if any(meaning.reason.startswith("CHECK") for meaning in holding.meanings.values()):
            yield "CHECK: what its channels hold"
        lacking = {m.joint for m in holding.meanings.values()} - {*holding.joints_of_ranges()}
        yield from (f"no position of {joints[k].name}" for k in sorted(lacking) if k < len(joints))
        yield from (f"joint of {name}" for name, symbol in self._without_joint().items() if symbol == "q")
        if self.role.role == "weight":
            yield "CHECK: the mass is taken to hang at the tip"

    def _role(self) -> Iterator[str]:
        others = ", ".join(role for role in ROLES if role != self.role.role)
        if not self.role.role:
            yield f'# role = "..."  # MISSING, as {self.role.reason}: {", ".join(ROLES)}'
            return
        yield f'role = "{self.role.role}"  # {self.role.reason}; or {others}'
        if self.role.role == "weight":
            mass = (
                f"weight = {{ mass = {self.role.mass:g} }}  #"
                if self.role.mass
                else "weight = {}  # mass = <kg, if known>;"
            )
            elsewhere = 'moves_with = "<joint>", position = [x, y, z], in m from the remote centre'
            yield f"{mass} CHECK: at the tip; elsewhere also {elsewhere}"
            if self.tare:
                yield f"tare = {_text(self.tare)}  # the run without the mass, to be subtracted"

    def _rate(self) -> Iterator[str]:
        timing, tissue = self.draft.guess.timing, bool(self.draft.touching)
        if timing.rate:
            yield f"rate = {timing.rate!r}  # [Hz] {timing.reason}"
        elif timing.missing:
            needs = "only the damping of the tissue needs it" if tissue else f"MISSING, as {timing.missing}"
            yield f"# rate = ...  # [Hz] {needs}"
        if timing.remark:
            yield f"# CHECK: {timing.remark}"

    def _contact(self) -> str:
        if not self.draft.touching:
            return "# contact = [[12.0, 14.5]]  # [s] windows of contact; or, without contact, free = [[0.0, 5.0]]"
        if reason := _touches_throughout(self.draft):
            return f'contact = "all"  # {reason}'
        return '# contact = "all"  # if every sample is in contact; otherwise contact is detected'

    def _without_joint(self) -> dict[str, str]:
        """Symbols by name of channels named as those of a joint, but of none of the robot's, while it lacks some."""
        holding = self.draft.guess
        if not holding.robot or len({m.joint for m in holding.meanings.values()}) == len(self.robot.joints):
            return {}
        names = [c.name for c in self.draft.log.channels if c.kind == "number" and c.name not in holding.meanings]
        return {name: symbol for name in names if (symbol := symbol_of(words_of(name)))}

    def _unknown_units(self) -> dict[str, str]:
        """Channels without a unit of joints that move farther than a drive, and which units they may have."""
        holding, unknown = self.draft.guess, {}
        reach = {k: max(-low, high) for k, (low, high) in zip(holding.joints_of_ranges(), holding.ranges, strict=True)}
        units = {channel.name: stated_unit(channel) for channel in self.draft.log.channels}
        for name, m in holding.meanings.items():
            if m.symbol not in ("q", "dq") or m.unit or units.get(name) or m.joint >= len(self.robot.joints):
                continue
            rate, far = "/s" * (m.symbol == "dq"), reach.get(m.joint, 0.0)
            unit, small, drive, in_small = UNKNOWN_UNITS[self.robot.joints[m.joint].kind]
            if far > in_small:
                counted = f'scale = <{unit}{rate} per count>, unit = "{unit}{rate}"'
                unknown[name] = f"the unit; its position reaches {far:.3g}, as counts do: {counted}"
            elif far > drive:
                unknown[name] = f"the unit is {small}{rate} or {unit}{rate}; in {unit}, its position reaches {far:.3g}"
        return unknown

    def _channels(self) -> Iterator[str]:
        """A line for each channel: what it is, with its unit and the reason, or a comment."""
        log, holding, touching = self.draft.log, self.draft.guess, self.draft.touching
        timing, unknown, without_joint = holding.timing, self._unknown_units(), self._without_joint()
        if timing.time.isdecimal():
            yield f"time = {timing.time}  # {timing.reason}"
        big = _in_millimetres(log, touching)
        for channel in log.channels:
            meaning = holding.meanings.get(channel.name)
            if channel.derived or channel.kind == "text":
                continue
            if channel.name in self.draft.sensor:
                line = _touch_line(channel, self.draft.sensor[channel.name], in_millimetres=False)
                sensor = "compared with the estimate; sign = -1 for a sensor of the force on the robot"
                yield f"{line}; {sensor}" if "CHECK" in line else f"{line}  # CHECK: {sensor}"
            elif channel.name in touching:
                yield _touch_line(channel, touching[channel.name], channel.name in big)
            elif meaning:
                yield self._meaning_line(channel, meaning, unknown.get(channel.name, ""))
            elif channel.name == timing.time:
                yield _time_line(channel, timing.size, timing.reason)
            elif channel.name == log.time:
                yield f"time = {_text(channel.name)}  # the log's own"
            elif is_time(channel):
                why = "the log has its own clock" if log.clock else "a time that is not used"
                yield f"# time = {_text(channel.name)}  # {why}"
            else:
                symbol = without_joint.get(channel.name, "")
                notes = ["MISSING: the joint"] * bool(symbol) + [f"in {channel.unit}"] * bool(channel.unit)
                notes += [f"{channel.alias}, no joint of {self.robot.name}"] * ("[" in channel.alias)
                comment = f"  # {'; '.join(notes)}" if notes else ""
                yield f'# "<joint>.{symbol or "<quantity>"}" = {_text(channel.name)}{comment}'

    def _meaning_line(self, channel: Channel, meaning: Meaning, unknown: str) -> str:
        """The line of a joint's channel; commented out where the joint does not move or is unknown."""
        if meaning.joint >= len(self.robot.joints):
            count = f"joint {meaning.joint + 1}, but {self.robot.name} has {len(self.robot.joints)}"
            return f'# "<joint>.{meaning.symbol}" = {_text(channel.name)}  # {count}'
        joint, holding = self.robot.joints[meaning.joint], self.draft.guess
        stated = stated_unit(channel)
        unit = _fitting(meaning, joint, hides_unit=stated != channel.unit)
        value = f"{{ channel = {_text(channel.name)}, unit = {_text(unit)} }}" if unit else _text(channel.name)
        note = f"in {stated}" if stated else f"in {unit}" if unit else "no unit: SI"
        if unknown:
            value, note = f'{{ channel = {_text(channel.name)}, unit = "" }}', f"MISSING: {unknown}"
        line = f"{_text(f'{joint.name}.{meaning.symbol}')} = {value}"
        if holding.moving and meaning.joint not in holding.moving and holding.robot is None:
            if meaning.joint not in holding.joints_of_ranges():
                return f"# {line}  # CHECK: no position of the joint"
            if self.robot.chain is None:
                return f"# {line}  # the joint does not move"
            note = f"{note}; does not move, but a model of the whole arm needs it"
        return f"{line}  # {meaning.reason}; {note}"


def _fitting(meaning: Meaning, joint: Joint, hides_unit: bool) -> str:
    """The unit in a channel's name, if it measures the quantity; a velocity called deg is in deg/s.

    `hides_unit`: the log takes a label for the unit, so that the unit has to be stated.
    """
    needed = kind_of_unit(joint, meaning.symbol)
    units = (meaning.unit, f"{meaning.unit}/s", SI[needed] if hides_unit else "")
    return next((unit for unit in units if measures(unit) == needed), "")


def _time_line(channel: Channel, size: float, reason: str) -> str:
    """The line of a channel of times, with its unit where the log does not state one that is known."""
    if measures(canonical(channel.unit)) == "time" or size == 1.0:
        return f"time = {_text(channel.name)}  # {reason}"
    unit = ', unit = "ms"' if size == 1e-3 else f', scale = {size!r}, unit = "s"'
    return f"time = {{ channel = {_text(channel.name)}{unit} }}  # {reason}"


def _path(files: Sequence[Path], folder: Path) -> list[str]:
    return [file.resolve().relative_to(folder.resolve()).as_posix() for file in files]


def _touches_throughout(draft: DraftLog) -> str:
    """Why every sample of numbered pushes is of contact: the force rises from the first sample on; else ""."""
    by_quantity = {quantity: name for name, quantity in draft.touching.items()}
    names = [by_quantity.get(quantity, "") for quantity in ("push", "depth", "force")]
    if not all(names) or len(draft.log.by_clock(names)) > 1:
        return ""
    push, depth, force = (samples_of(draft.log, names)[name] for name in names)
    starts = np.flatnonzero(np.diff(push)) + 1
    if touches_at_once(list(zip(np.split(depth, starts), np.split(force, starts), strict=True))):
        return "the force rises from the first sample of each push on, as of a probe that touches the surface"
    return ""


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
    unit = unit or SI[OF_THE_LOG[quantity]]
    return f"{quantity} = {{ channel = {_text(channel.name)}, unit = {_text(unit)} }}{where}"


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
