"""Convert the channels of a log to quantities of joints in one pass: clocks, units, gears, and remarks."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from davinci_forces.logs.joined import FILLED_IN
from davinci_forces.logs.log import Block, Channel, Log, row_count
from davinci_forces.maths.arrays import Booleans
from davinci_forces.maths.signals.clock import ClockStatistics
from davinci_forces.maths.signals.faults import steps
from davinci_forces.maths.units import SI, UNITS, canonical, measures, size, unit_among_words
from davinci_forces.records import Column, Counts, Recording, Touch
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study import WHOLE_LOG, LogEntry, Source
from davinci_forces.study.channels import ALTERNATIVES, AXES, FORCE
from davinci_forces.study.intake.clocks import ALIGNED, UsedClocks

MAX_VALUE = 1e30  # of a sample in the unit of its channel; no quantity of an arm is larger, nor are times in ns
HISTORY = 1 << 13  # samples before a jump of the clock in which the motion may have repeated

# Channels of the log by the columns of a Touch; channels of joints become recordings.
TOUCH_COLUMNS = {name: name for name in ("depth", "force", *FORCE)} | {axis: f"tip_{axis}" for axis in AXES}


def touch_of(reading: "Intake", block: Block, t: Column, selected: Booleans) -> Touch | None:
    """The contact quantities of a block; NaN in columns for which the log has no channel."""
    if not set(reading.sources) & {*TOUCH_COLUMNS.values(), "push"}:
        return None
    unknown = np.full(len(t), np.nan)
    columns = {
        name: reading.to_si(block, quantity) if quantity in reading.sources else unknown
        for name, quantity in TOUCH_COLUMNS.items()
    }
    return Touch(
        log=reading.entry.name, role=reading.entry.role, sample=(reading.rows + np.arange(len(t)))[selected],
        push=_pushes(reading, block, len(t))[selected], t=(t if reading.clocks.all_timed else unknown)[selected],
        **{name: column[selected] for name, column in columns.items()},
    )  # fmt: skip


def _pushes(reading: "Intake", block: Block, rows: int) -> Counts:
    """The numbers of the pushes; 0 throughout where the log does not count them."""
    if "push" not in reading.sources:
        return np.zeros(rows, dtype=np.int64)
    numbers = reading.to_si(block, "push")
    odd = np.flatnonzero((numbers != np.round(numbers)) | (np.abs(numbers) >= 2**53))
    if len(odd):
        where = f"at row {reading.rows + int(odd[0])} (counted from 0)"
        first = f"channel {reading.channels['push'].name!r} holds {numbers[odd[0]]:g} {where}"
        remedy = "name another channel, or leave push out and the pushes are detected"
        raise reading.log.bad(f"{first}, but the number of a push must be whole; {remedy}")
    return numbers.astype(np.int64)


@dataclass
class Intake:
    """One pass over a log: its channels by quantity, and the state of its clock."""

    log: Log
    entry: LogEntry
    robot: Robot
    clock: ClockStatistics = field(default_factory=ClockStatistics)
    rows: int = 0
    ended: bool = False  # whether the `until` of the study was reached
    jumps: list[tuple[float, float]] = field(default_factory=list)  # times of clock jumps, and their sizes [s]

    def __post_init__(self) -> None:
        self.sources = {s.quantity: s for s in self.entry.channels}
        self.channels = {
            q: self.log.times_called(s.channel)[0] if q == "time" else self.log.find(s.channel)
            for q, s in self.sources.items()
        }
        self.scales = {q: s.scale * self.unit(s, self.channels[q]) for q, s in self.sources.items()}
        used = list(dict.fromkeys(channel.name for quantity, channel in self.channels.items() if quantity != "time"))
        positions = (f"{joint}.{symbol}" for joint in self.entry.joints for symbol in ("q", "theta_m"))
        reference = next((self.channels[q].name for q in positions if q in self.channels), used[0] if used else "")
        self.clocks = UsedClocks(self.log, self.entry, self.scales.get("time", 1.0), used, reference)
        if not self.clocks.all_timed and self.entry.needs_clock and not self.clocks.are_several:
            raise self.log.bad("the log has no clock; name its time channel in [log.channels], or give rate = ... [Hz]")
        has_seconds = self.entry.skip or self.entry.until or self.entry.contact not in ((), WHOLE_LOG)
        if not self.clocks.all_timed and has_seconds:
            why = "the log has no clock, but skip, until and contact windows are in seconds"
            remedy = 'give rate = ... [Hz], or leave them out; contact = "all" needs no clock'
            raise self.log.bad(f"{why}; {remedy}")
        self.names = list(dict.fromkeys([*used, *([self.clocks.time] if self.clocks.time else [])]))

    def unit(self, source: Source, channel: Channel) -> float:
        """The size of a channel's unit in SI: as the study gives it, else the log, else 1."""
        log_unit = "s" if channel.kind == "time" else canonical(channel.unit)
        by_word = channel.name[-1:] not in "])}" and log_unit == canonical(unit_among_words(channel.name))
        misread = source.unit is not None and by_word and measures(log_unit) != source.measures  # `q_ma`: an average
        if misread or source.scale != 1.0:  # the stated unit is the unit after scaling
            log_unit = ""
        fact = f"channel {channel.name!r} is in {channel.unit!r}"
        if source.unit and log_unit in UNITS and log_unit != source.unit:
            remedy = f"correct the unit of {source.quantity} in study.toml, or leave it out"
            raise self.log.bad(f"{fact}, but study.toml says {source.unit!r}; {remedy}")
        unit = source.unit or log_unit or SI[source.measures]
        if source.measures == "count":
            return 1.0
        if measures(unit) != source.measures:
            what = f"measures {measures(unit)}" if unit in UNITS else "is an unknown unit"
            fitting = ", ".join(u for u in UNITS if measures(u) == source.measures)
            need = f"{source.quantity} needs {source.measures}; give its unit in study.toml, one of {fitting}"
            raise self.log.bad(f"{fact}, which {what}, but {need}")
        return size(unit)

    def positions(self, block: Block) -> Column:
        """The positions of all joints, on the joint side, one a row."""
        either = [self.of_joint(block, self.robot.joint(name), ("q", "theta_m")) for name in self.entry.joints]
        return np.array([q for q in either if q is not None])

    def recordings(self, block: Block) -> Iterator[Recording | Touch]:
        """Convert one block to recordings of its joints and a touch, without the skipped start."""
        block = self.until_the_end(block)
        if not row_count(block):
            return
        for name in (name for name in self.names if name in block):
            self.require_numbers(name, block[name])
        t = self.clocks.times(block, self.rows)
        self.clock.update(t, [block[c.name] for q, c in self.channels.items() if q != "time"])
        if self.clock.backward or self.clock.repeated:
            before, after = self.clock.bad_pair
            where = f"at row {self.clock.bad_row} (counted from 0): {before:.9g} s, then {after:.9g} s"
            remedy = "name another time channel, or give rate = ... [Hz] to count samples instead"
            raise self.log.bad(f"time does not increase {where}; {remedy}")
        first = self.clock.first
        selected = t - first >= self.entry.skip - 1e-9
        for name in self.entry.joints:
            joint = self.robot.joint(name)
            q, tau, dq = (self.of_joint(block, joint, either) for either, _ in ALTERNATIVES)
            assert q is not None
            assert tau is not None
            yield Recording(
                log=self.entry.name, joint=name, role=self.entry.role, rate=self.clock.rate,
                velocity="derived" if dq is None else "logged", t=(t - first)[selected], q=q[selected],
                dq=np.zeros(int(selected.sum())) if dq is None else dq[selected], tau=tau[selected],
                filled=block[FILLED_IN][selected].astype(np.int64),
            )  # fmt: skip
        if touch := touch_of(self, block, t - first, selected & (block[FILLED_IN] == 0)):
            yield touch
        self.rows += len(t)

    def until_the_end(self, block: Block) -> Block:
        """A block without the rows after the study's `until`, whatever they hold."""
        if self.entry.until is None or not row_count(block):
            return block
        t = self.clocks.times(block, self.rows)
        after = np.flatnonzero(t - (self.clock.first if self.rows else t[0]) > self.entry.until + 1e-9)
        if not len(after):
            return block
        self.ended = True
        return {name: values[: int(after[0])] for name, values in block.items()}

    def to_si(self, block: Block, quantity: str) -> Column:
        """Convert a channel to SI: offset first, in the channel's unit, then sign, scale and unit."""
        source = self.sources[quantity]
        shifted = block[self.channels[quantity].name] + source.offset
        return shifted * (source.sign * self.scales[quantity])

    def of_joint(self, block: Block, joint: Joint, either: tuple[str, str]) -> Column | None:
        """A quantity on the joint side, converted from the motor side of the gears if needed.  (6.28), (6.29)"""
        at_joint, at_motor = (f"{joint.name}.{symbol}" for symbol in either)
        if at_joint in self.sources:
            return self.to_si(block, at_joint)
        if at_motor not in self.sources:
            return None
        value = self.to_si(block, at_motor)
        ratio = joint.gear_ratio
        if either[1] != "i":
            return value / ratio
        return value if joint.effort else value * ratio * joint.torque_constant

    def require_numbers(self, name: str, values: Column) -> None:
        """Refuse a time that is missing, or a sample that is infinite or so large that its square would be."""
        bad = np.flatnonzero(~(np.abs(values) < MAX_VALUE))
        if not len(bad):
            return
        first = f"holds {values[bad[0]]} at row {self.rows + int(bad[0])} (counted from 0)"
        share = f"{len(bad)} of the {len(values)} rows read with it lack a number"
        remedy = "record the log again, or save the part before this row as a separate log"
        raise self.log.bad(f"channel {name!r} {first}, and {share}; {remedy}")


def without_clock_jumps(intake: Intake, blocks: Iterator[Block]) -> Iterator[Block]:
    """Remove jumps of the clock from its channel, where the motion shows that no time passed.

    Only for identification logs: others lose nothing by a gap, and their contact windows are times of their clock.
    The end of a block waits for the next, which shows how the motion continues, and whether it repeats.
    """
    first = next(blocks, None)  # with it, the clocks are known
    several = intake.clocks.are_several
    name, blocks = ALIGNED if several else intake.clocks.time, chain([first] if first else [], blocks)
    if not name or intake.entry.role != "identification":
        yield from blocks
        return
    from_study = intake.clocks.groups[0].is_stated and not several
    scale = intake.sources["time"].sign * intake.scales["time"] if from_study else 1.0
    scale *= intake.clocks.units.get(name, 1.0)
    passed = 0.0  # sum of the jumps, in the channel's unit
    waiting: Block = {}
    for block in blocks:
        late = block | {name: block[name] - passed} if passed else block
        joined = {key: np.concatenate([waiting[key], late[key]]) for key in late} if waiting else late
        for i, jump in steps(intake.clocks.times(joined, intake.rows), intake.positions(joined)):
            joined = joined | {name: joined[name] - np.where(np.arange(len(joined[name])) < i, 0.0, jump / scale)}
            passed += jump / scale
            intake.jumps.append((float(intake.clocks.times(joined, intake.rows)[i - 1]), jump))
        ready = max(len(joined[name]) - HISTORY, 0)
        waiting = {key: values[ready:] for key, values in joined.items()}
        yield {key: values[:ready] for key, values in joined.items()}
    if waiting:
        yield waiting
