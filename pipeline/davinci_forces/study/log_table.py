"""Write the [[log]] table of one log of a draft, and its row of the table that `new` prints."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces.logs.log import Channel, Log
from davinci_forces.maths.tissue.palpation import touches_at_once
from davinci_forces.maths.units import SI, canonical, measures
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import belonging
from davinci_forces.study.channels import OF_THE_LOG, kind_of_unit, unit_of
from davinci_forces.study.entries import ROLES
from davinci_forces.study.holding import POSITIONS, Holding, Meaning
from davinci_forces.study.names import is_time, stated_unit, symbol_of, words_of
from davinci_forces.study.roles import Role
from davinci_forces.study.timing import samples_of
from davinci_forces.toml import in_toml

# Of joints: two units, and the farthest that a drive goes in both; beyond the second, a position is in counts.
UNKNOWN_UNITS = {
    Kind.REVOLUTE: ("rad", "deg", belonging.MAX_ANGLE_DRIVE, 3600.0),
    Kind.PRISMATIC: ("m", "mm", 2.0, 2000.0),
}
MAX_SPAN = 0.5  # [m] of a tip's path or a push's depth; values that span more are in mm


class Row(NamedTuple):
    """One log in the table that `new` ends with."""

    file: str
    role: str
    rate: str
    joints: str
    look_at: str


@dataclass(frozen=True)
class DraftLog:
    """One [[log]]: its files, the opened log, the guess of its channels, quantities of pushes by channel."""

    files: list[Path]
    log: Log
    guess: Holding
    touching: dict[str, str]
    sensor: dict[str, str] = field(default_factory=dict)  # quantities of a force sensor beside joints, by channel

    @property
    def name(self) -> str:
        """The name of its first file, as a valid name of a log."""
        first = self.files[0]
        name = belonging.split_signal(first)[0] if len(self.files) > 1 else first.name.partition(".")[0]
        return re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_") or "log"


@dataclass(frozen=True)
class LogTable:
    """Writes the [[log]] of one recording, and its row of the table."""

    draft: DraftLog
    name: str
    folder: Path
    robot: Robot
    role: Role
    tare: str

    def lines(self) -> list[str]:
        """The lines of the [[log]]; all of them comments if nothing in the log can be used."""
        paths = [in_toml(path) for path in paths_in(self.draft.files, self.folder)]
        join = f"join = [{', '.join(paths)}]  # one signal per file"
        period = "# period = 10.0  # [s] estimated from the data; in an identification log, a given value is checked"
        block = [
            "[[log]]",
            f"name = {in_toml(self.name)}",
            f"file = {paths[0]}" if len(paths) == 1 else join,
            *self._role(),
            *([] if self.draft.touching else [period]),
            *self._rate(),
            "# skip = 1.0  # [s] at the start to leave out of every fit, if it was touched or is faulty",
            "# until = 60.0  # [s] end of the log: later samples, a stop for instance, are left out",
            *self._contact(),
            "[log.channels]",
            *self._channels(),
            "# quantities of a joint: q or theta_m, dq or dtheta_m, tau or i",
            "# of the log: time; of tissue also push, depth or tip_x, tip_y, tip_z, force or force_x, force_y, force_z",
        ]
        if not self.why_empty:
            return ["", *block]
        return ["", f"# {self.name}: left out: {self.why_empty}", *(f"# {line.removeprefix('# ')}" for line in block)]

    @property
    def why_empty(self) -> str:
        """Why nothing in the log can be used, so that it is written commented out; else ""."""
        if self.draft.guess.meanings or self.draft.touching:
            return ""
        names = [channel.name for channel in self.draft.log.channels if not channel.derived]
        some = ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")
        return f"no position and effort of a joint, and no depth and force, among {some}"

    def row(self) -> Row:
        """The log in the table: its role, its rate, its joints, and what to look at first."""
        timing, holding = self.draft.guess.timing, self.draft.guess
        rate = f"{1 / timing.step:.5g} Hz" if timing.step else "missing" if timing.missing else "-"
        joints = [self.robot.joints[k].name for k in holding.moving if k < len(self.robot.joints)]
        look = [self.why_empty] if self.why_empty else [*self._doubts(), self.role.reason]
        role = "left out" if self.why_empty else self.role.role or "missing"
        file = ", ".join(paths_in(self.draft.files[:1], self.folder)) + (" ..." if len(self.draft.files) > 1 else "")
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
        lacking = holding.joints_with() - holding.joints_with(POSITIONS)
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
            mass = f"{{ mass = {self.role.mass:g} }}  #" if self.role.mass else "{}  # mass = <kg, if known>;"
            elsewhere = 'moves_with = "<joint>", position = [x, y, z], in m from the remote centre'
            yield f"weight = {mass} CHECK: at the tip; elsewhere also {elsewhere}"
            if self.tare:
                yield f"tare = {in_toml(self.tare)}  # the run without the mass, to be subtracted"

    def _rate(self) -> Iterator[str]:
        timing, tissue = self.draft.guess.timing, bool(self.draft.touching)
        if timing.rate:
            yield f"rate = {timing.rate!r}  # [Hz] {timing.reason}"
        elif timing.missing:
            needs = "only the damping of the tissue needs it" if tissue else f"MISSING, as {timing.missing}"
            yield f"# rate = ...  # [Hz] {needs}"
        if timing.remark:
            yield f"# CHECK: {timing.remark}"

    def _contact(self) -> list[str]:
        if not self.draft.touching:
            contact = "# contact = [[12.0, 14.5]]  # [s] of contact; without `free`, all else counts as free"
            return [contact, "# free = [[0.0, 5.0]]  # [s] when nothing touched the arm, as far as you know"]
        if reason := _touches_throughout(self.draft):
            return [f'contact = "all"  # {reason}']
        return ['# contact = "all"  # if every sample is in contact; otherwise contact is detected']

    def _without_joint(self) -> dict[str, str]:
        """Symbols by name of channels named as those of a joint, but of none of the robot's, while it lacks some."""
        holding = self.draft.guess
        if not holding.robot or len(holding.joints_with()) == len(self.robot.joints):
            return {}
        names = [c.name for c in self.draft.log.channels if c.kind == "number" and c.name not in holding.meanings]
        return {name: symbol for name in names if (symbol := symbol_of(words_of(name)))}

    def _unknown_units(self) -> dict[str, str]:
        """Channels without a unit of joints that move farther than a drive, and which units they may have."""
        holding, unknown = self.draft.guess, {}
        units = {channel.name: stated_unit(channel) for channel in self.draft.log.channels}
        for name, m in holding.meanings.items():
            if m.symbol not in ("q", "dq") or m.unit or units.get(name) or m.joint >= len(self.robot.joints):
                continue
            rate, far = "/s" * (m.symbol == "dq"), max(map(abs, holding.ranges.get(m.joint, (0.0,))))
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
        for channel in (channel for channel in log.channels if not channel.derived and channel.kind != "text"):
            meaning = holding.meanings.get(channel.name)
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
                yield f"time = {in_toml(channel.name)}  # the log's own"
            elif is_time(channel):
                why = "the log has its own clock" if log.clock or log.time else "a time that is not used"
                yield f"# time = {in_toml(channel.name)}  # {why}"
            else:
                symbol = without_joint.get(channel.name, "")
                notes = ["MISSING: the joint"] * bool(symbol) + [f"in {channel.unit}"] * bool(channel.unit)
                notes += [f"{channel.alias}, no joint of {self.robot.name}"] * ("[" in channel.alias)
                comment = f"  # {'; '.join(notes)}" if notes else ""
                yield f'# "<joint>.{symbol or "<quantity>"}" = {in_toml(channel.name)}{comment}'

    def _meaning_line(self, channel: Channel, meaning: Meaning, unknown: str) -> str:
        """The line of a joint's channel; commented out where the joint does not move or is unknown."""
        if meaning.joint >= len(self.robot.joints):
            count = f"joint {meaning.joint + 1}, but {self.robot.name} has {len(self.robot.joints)}"
            return f'# "<joint>.{meaning.symbol}" = {in_toml(channel.name)}  # {count}'
        joint, holding, stated = self.robot.joints[meaning.joint], self.draft.guess, stated_unit(channel)
        unit = _fitting(meaning, joint, hides_unit=stated != channel.unit)
        value = f"{{ channel = {in_toml(channel.name)}, unit = {in_toml(unit)} }}" if unit else in_toml(channel.name)
        note = f"in {stated}" if stated else f"in {unit}" if unit else "no unit: SI"
        if unknown:
            value, note = f'{{ channel = {in_toml(channel.name)}, unit = "" }}', f"MISSING: {unknown}"
        line = f"{in_toml(f'{joint.name}.{meaning.symbol}')} = {value}"
        if holding.moving and meaning.joint not in holding.moving and holding.robot is None:
            if meaning.joint not in holding.joints_with(POSITIONS):
                return f"# {line}  # CHECK: no position of the joint"
            if self.robot.chain is None:
                return f"# {line}  # the joint does not move"
            note = f"{note}; does not move, but a model of the whole arm needs it"
        alias = f"{channel.alias}, " if "[" in channel.alias else ""
        return f"{line}  # {alias}{meaning.reason}; {note}"


def _fitting(meaning: Meaning, joint: Joint, hides_unit: bool) -> str:
    """The unit in a channel's name, if it measures the quantity; a velocity called deg is in deg/s."""
    needed = kind_of_unit(joint, meaning.symbol)
    units = (meaning.unit, f"{meaning.unit}/s", SI[needed] if hides_unit else "")  # stated where a label seems a unit
    return next((unit for unit in units if measures(unit) == needed), "")


def _time_line(channel: Channel, size: float, reason: str) -> str:
    """The line of a channel of times, with its unit where the log does not state one that is known."""
    if measures(canonical(channel.unit)) == "time" or size == 1.0:
        return f"time = {in_toml(channel.name)}  # {reason}"
    unit = ', unit = "ms"' if size == 1e-3 else f', scale = {size!r}, unit = "s"'
    return f"time = {{ channel = {in_toml(channel.name)}{unit} }}  # {reason}"


def paths_in(files: Sequence[Path], folder: Path) -> list[str]:
    """The paths of files in a folder, as study.toml has them."""
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
    lengths = [name for name, quantity in touching.items() if OF_THE_LOG[quantity] == "length"]
    names = [name for name in lengths if not unit_of(log.find(name), touching[name])]
    if not names or len(log.by_clock(names)) > 1:
        return set()
    samples = samples_of(log, names)
    return set(names) if max(float(np.ptp(values)) for values in samples.values() if len(values)) > MAX_SPAN else set()


def _touch_line(channel: Channel, quantity: str, in_millimetres: bool) -> str:
    if quantity == "push":
        return f"push = {in_toml(channel.name)}  # number of the push"
    unit = unit_of(channel, quantity)
    if in_millimetres:
        return f'{quantity} = {{ channel = {in_toml(channel.name)}, unit = "mm" }}  # unit by the size of its values'
    where = "" if channel.unit else "  # unit by its name" if unit else "  # the log gives no unit: CHECK THIS"
    unit = unit or SI[OF_THE_LOG[quantity]]
    return f"{quantity} = {{ channel = {in_toml(channel.name)}, unit = {in_toml(unit)} }}{where}"
