"""Read every log into recordings, one per joint, in SI and at the joint's side of the gears; and what touched."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import BadLog
from pipeline.logs.log import Block, Channel, Log
from pipeline.maths.arrays import Booleans
from pipeline.maths.signals.clock import GAP, ClockStatistics
from pipeline.maths.signals.steps import REACH, steps
from pipeline.maths.units import SI, UNITS, canonical, measures, size
from pipeline.records import Column, Counts, Diagnostic, LogSummary, Recording, Touch, diagnostic
from pipeline.robots.robot import Joint, Robot
from pipeline.study import WHOLE, LogEntry, Source

MOST_REPEATED = 0.1  # share of rows equal to the one before, above which the recorder was faster than the robot
MOST_JITTER = 0.1  # of the sampling time
# Channels of the log by the columns of a Touch; those of joints become recordings.
TOUCHED = {
    "depth": "depth", "force": "force", "force_x": "force_x", "force_y": "force_y", "force_z": "force_z",
    "x": "tip_x", "y": "tip_y", "z": "tip_z",
}  # fmt: skip


def run(log: Log, entry: LogEntry, robot: Robot) -> Iterator[Recording | Touch | LogSummary | Diagnostic]:
    """Recordings and touches in consecutive blocks, then what the reader noticed.

    Raises
    ------
    BadLog
        If a channel is not there, its unit is unknown or contradicts the study, it holds what is not a number, or
        time does not increase.
    """
    reading = Reading(log, entry, robot)
    for block in reading.mended(log.blocks(reading.names)):
        yield from reading.recordings(block)
        if reading.ended:
            break
    yield reading.intake()
    remarks = [*log.warnings, *reading.remarks()]
    if remarks:
        yield diagnostic("ingest", entry.name, "warning", *(f"{entry.name}: {remark}" for remark in remarks))


@dataclass
class Reading:
    """One pass over a log: which channels feed what, and how far the clock has come."""

    log: Log
    entry: LogEntry
    robot: Robot
    clock: ClockStatistics = field(default_factory=ClockStatistics)
    rows: int = 0
    lost: int = 0  # at the end of a file that was cut
    ended: bool = False  # where the study says that the log ends
    jumps: list[tuple[float, float]] = field(default_factory=list)  # when the clock stepped, and how far

    def __post_init__(self) -> None:
        self.channels = {s.quantity: self.log.find(s.channel) for s in self.entry.channels}
        self.scales = {s.quantity: self.scale(s, self.channels[s.quantity]) for s in self.entry.channels}
        self.sources = {s.quantity: s for s in self.entry.channels}
        names = [channel.name for channel in self.channels.values()]
        if self.own_time:
            names.append(self.own_time)
        elif not self.clocked and self.entry.needs_clock:
            raise BadLog(
                f"{self.log.path}: the log carries no clock; name its time channel in [log.channels], "
                "or say rate = ... [Hz]"
            )
        if not self.clocked and (self.entry.skip or self.entry.until or self.entry.contact not in ((), WHOLE)):
            raise BadLog(
                f"{self.log.path}: the log carries no clock, but skip, until and contact windows count in seconds; say "
                'rate = ... [Hz], or leave them out: contact = "all" needs no clock'
            )
        self.names = list(dict.fromkeys(names))

    @property
    def clocked(self) -> bool:
        """Whether anything says when the samples were taken."""
        return bool("time" in self.sources or self.entry.rate or self.own_time or self.log.clock)

    @property
    def own_time(self) -> str:
        """The log's own time channel, unless the study says otherwise."""
        return "" if "time" in self.sources or self.entry.rate else self.log.time

    def scale(self, source: Source, channel: Channel) -> float:
        """What one unit of a channel is in SI: by the study's word, else the log's, else SI."""
        said = canonical(channel.unit)
        if source.unit and said in UNITS and said != source.unit:
            raise BadLog(
                f"{self.log.path}: channel {channel.name!r} says {channel.unit!r} and study.toml says {source.unit!r}; "
                f"correct the unit of {source.quantity} in study.toml, or leave it out"
            )
        unit = source.unit or said or SI[source.measures]
        if source.measures == "count":
            return 1.0
        if measures(unit) != source.measures:
            what = f"measures {measures(unit)}" if unit in UNITS else "is not known"
            fitting = ", ".join(u for u in UNITS if measures(u) == source.measures)
            raise BadLog(
                f"{self.log.path}: channel {channel.name!r} is in {channel.unit!r}, which {what}, but "
                f"{source.quantity} needs {source.measures}; say unit = ... for it in study.toml: {fitting}"
            )
        return size(unit)

    def mended(self, blocks: Iterator[Block]) -> Iterator[Block]:
        """The blocks with steps of the clock taken out of its channel, where the motion tells that no time passed.

        Of identification logs only: others lose nothing by a gap, and their contact windows count on their clock.
        The end of a block waits for the next, which says how the motion goes on.
        """
        name = self.channels["time"].name if "time" in self.channels else self.own_time
        whole = (self.without_cut_end(block) for block in blocks)
        if not name or self.entry.role != "identification":
            yield from whole
            return
        scale = self.sources["time"].sign * self.scales["time"] if "time" in self.sources else 1.0
        passed = 0.0  # by the channel, in its unit, while nothing moved on
        waiting: Block = {}
        for block in whole:
            late = block | {name: block[name] - passed} if passed else block
            joined = {key: np.concatenate([waiting[key], late[key]]) for key in late} if waiting else late
            for i, jump in steps(self.times(joined), self.positions(joined)):
                joined = joined | {name: joined[name] - np.where(np.arange(len(joined[name])) < i, 0.0, jump / scale)}
                passed += jump / scale
                self.jumps.append((float(self.times(joined)[i - 1]), jump))
            ready = max(len(joined[name]) - 2 * REACH, 0)
            waiting = {key: values[ready:] for key, values in joined.items()}
            yield {key: values[:ready] for key, values in joined.items()}
        if waiting:
            yield waiting

    def positions(self, block: Block) -> Column:
        """The positions of all joints at the joints, one a row."""
        either = [self.of_joint(block, self.robot.joint(name), ("q", "theta_m")) for name in self.entry.joints]
        return np.array([q for q in either if q is not None])

    def recordings(self, block: Block) -> Iterator[Recording | Touch]:
        """The joints of one block, and what touched, after the transient that the study skips."""
        block = self.until_the_end(block)
        if not len(block[self.names[0]]):
            return
        for name in self.names:
            self.require_numbers(name, block[name])
        t = self.times(block)
        self.clock.update(t, np.column_stack([block[c.name] for q, c in self.channels.items() if q != "time"]))
        self.require_increasing()
        first = self.clock.first
        kept = t - first >= self.entry.skip - 1e-9
        for name in self.entry.joints:
            joint = self.robot.joint(name)
            q, dq, tau = (
                self.of_joint(block, joint, either) for either in (("q", "theta_m"), ("dq", "dtheta_m"), ("tau", "i"))
            )
            assert q is not None
            assert tau is not None
            yield Recording(
                log=self.entry.name,
                joint=name,
                role=self.entry.role,
                rate=self.clock.rate,
                velocity="derived" if dq is None else "logged",
                t=(t - first)[kept],
                q=q[kept],
                dq=np.zeros(int(kept.sum())) if dq is None else dq[kept],
                tau=tau[kept],
            )
        if touched := self.touched(block, t - first, kept):
            yield touched
        self.rows += len(t)

    def touched(self, block: Block, t: Column, kept: Booleans) -> Touch | None:
        """What the channels of the log say of contact; NaN in columns that it has no channel of."""
        if not set(self.sources) & {*TOUCHED.values(), "push"}:
            return None
        unknown = np.full(len(t), np.nan)
        columns = {
            name: self.converted(block, quantity) if quantity in self.sources else unknown
            for name, quantity in TOUCHED.items()
        }
        return Touch(
            log=self.entry.name,
            role=self.entry.role,
            sample=(self.rows + np.arange(len(t)))[kept],
            push=self.pushes(block, len(t))[kept],
            t=(t if self.clocked else unknown)[kept],
            **{name: column[kept] for name, column in columns.items()},
        )

    def pushes(self, block: Block, rows: int) -> Counts:
        """The numbers of the pushes, 0 throughout where the log does not count them."""
        if "push" not in self.sources:
            return np.zeros(rows, dtype=np.int64)
        numbers = self.converted(block, "push")
        odd = np.flatnonzero((numbers != np.round(numbers)) | (np.abs(numbers) >= 2**53))
        if len(odd):
            raise BadLog(
                f"{self.log.path}: channel {self.channels['push'].name!r} holds {numbers[odd[0]]:g} at row "
                f"{self.rows + int(odd[0])} (counted from 0), but the number of a push is a whole one; name another "
                "channel, or leave push out, and pushes are found"
            )
        return numbers.astype(np.int64)

    def without_cut_end(self, block: Block) -> Block:
        """A block without the rows at the end of a file that was cut, which some channels no longer have."""
        if not self.log.cut:
            return block
        whole = np.all([np.isfinite(block[name]) for name in self.names], axis=0)
        rows = np.flatnonzero(whole)
        end = int(rows[-1]) + 1 if len(rows) else 0
        self.lost += len(whole) - end
        return {name: values[:end] for name, values in block.items()}

    def until_the_end(self, block: Block) -> Block:
        """A block without the rows after the time at which the study says that the log ends, whatever they hold."""
        if self.entry.until is None or not len(block[self.names[0]]):
            return block
        t = self.times(block)
        after = np.flatnonzero(t - (self.clock.first if self.rows else t[0]) > self.entry.until + 1e-9)
        if not len(after):
            return block
        self.ended = True
        return {name: values[: int(after[0])] for name, values in block.items()}

    def times(self, block: Block) -> Column:
        """Time of each row [s], by the study's time channel, its rate, the log's time channel or the log's clock; of a
        log without any, its number.
        """
        if "time" in self.sources:
            return self.converted(block, "time")
        rows = self.rows + np.arange(len(block[self.names[0]]))
        if self.entry.rate:
            return rows / self.entry.rate
        if self.own_time:
            return block[self.own_time]
        if self.log.clock is None:  # samples are counted
            return rows.astype(np.float64)
        return np.asarray(self.log.clock.start + rows * self.log.clock.step, dtype=np.float64)

    def converted(self, block: Block, quantity: str) -> Column:
        """A channel in SI: offset first, in the channel's unit, then sign and unit."""
        source = self.sources[quantity]
        shifted = block[self.channels[quantity].name] + source.offset
        return shifted * (source.sign * self.scales[quantity])

    def of_joint(self, block: Block, joint: Joint, either: tuple[str, str]) -> Column | None:
        """A quantity at the joint, from whichever side of the gears it was logged on.  (6.28), (6.29)"""
        at_joint, at_motor = (f"{joint.name}.{symbol}" for symbol in either)
        if at_joint in self.sources:
            return self.converted(block, at_joint)
        if at_motor not in self.sources:
            return None
        value = self.converted(block, at_motor)
        ratio = joint.gear_ratio
        if either[1] != "i":
            return value / ratio
        return value if joint.effort else value * ratio * joint.torque_constant

    def require_numbers(self, name: str, values: Column) -> None:
        """Refuse a channel with samples that are missing or not numbers."""
        bad = np.flatnonzero(~np.isfinite(values))
        if not len(bad):
            return
        row = self.rows + int(bad[0])
        missing = self.log.nulls.get(name, 0)
        what = f"has no sample at row {row}" if missing else f"holds {values[bad[0]]} at row {row}"
        raise BadLog(
            f"{self.log.path}: channel {name!r} {what} (counted from 0), and {len(bad)} of the {len(values)} rows "
            "read with it lack a number; record it again, or give the part before it as a log of its own"
        )

    def require_increasing(self) -> None:
        """Refuse a clock that stands still or goes back, and say where."""
        clock = self.clock
        if clock.backward or clock.repeated:
            raise BadLog(
                f"{self.log.path}: time does not increase at row {clock.bad_row} (counted from 0): "
                f"{clock.bad_pair[0]:.9g} s, then {clock.bad_pair[1]:.9g} s; name another time channel, "
                "or say rate = ... [Hz] to count samples instead"
            )

    def intake(self) -> LogSummary:
        """What the reader noticed, once the log is exhausted.

        Raises
        ------
        BadLog
            If nothing is left to analyse.
        """
        clock, log, nan = self.clock, self.log, float("nan")
        if clock.samples < 2 or clock.last - clock.first <= self.entry.skip:
            until = f" and what comes after {self.entry.until:g} s left out" if self.ended else ""
            raise BadLog(
                f"{log.path}: {clock.samples} samples are too few, with {self.entry.skip:g} s skipped at the start"
                f"{until}"
            )
        feeds: dict[str, list[str]] = {}
        for quantity, channel in self.channels.items():
            feeds.setdefault(channel.name, []).append(quantity)
        if self.own_time:
            feeds.setdefault(self.own_time, []).append("time")
        names = [channel.name for channel in log.channels]
        facts = {**log.facts, **({"comments": "; ".join(log.comments)} if log.comments else {})}
        return LogSummary(
            log=self.entry.name,
            role=self.entry.role,
            format=log.format,
            files=self.entry.files,
            started=log.started,
            zone=log.zone,
            rows=clock.samples,
            rate=clock.rate if self.clocked else nan,
            duration=clock.last - clock.first if self.clocked else nan,
            jitter=clock.jitter if self.clocked else nan,
            longest_gap=clock.longest_gap if self.clocked else nan,
            backward=clock.backward,
            repeated=clock.repeated,
            duplicates=clock.duplicates,
            dropped=log.dropped + self.lost,
            facts=tuple(f"{key}: {value}" for key, value in facts.items()),
            warnings=tuple(log.warnings),
            channel=np.array(names, object),
            unit=np.array([channel.unit for channel in log.channels], object),
            feeds=np.array([", ".join(feeds.get(name, [])) for name in names], object),
            nulls=np.array([log.nulls.get(name, 0) for name in names]),
            nans=np.array([log.nans.get(name, 0) for name in names]),
        )

    def remarks(self) -> Iterator[str]:
        """What a reviewer should know about the clock and the rows."""
        clock = self.clock
        if self.jumps:
            when = ", ".join(f"{jump:.6g} s after {t - clock.first:.3f} s" for t, jump in self.jumps[:5])
            more = " ..." if len(self.jumps) > 5 else ""
            yield (
                f"the clock jumps while the motion goes on, by {when}{more}: the times after it are set back; find out "
                "why the recorder does so"
            )
        for start, end in self.entry.contact:
            if start >= clock.last - clock.first or end <= self.entry.skip:
                yield (
                    f"the contact window {start:g} to {end:g} s lies outside the log, which goes from "
                    f"{self.entry.skip:g} to {clock.last - clock.first:g} s; contact times count from the log's first "
                    "sample"
                )
        if (
            self.entry.until is not None
            and not self.ended
            and clock.last - clock.first < self.entry.until - GAP / clock.rate
        ):
            yield (
                f"until = {self.entry.until:g} s leaves nothing out, because the log ends after "
                f"{clock.last - clock.first:g} s; both count from its first sample"
            )
        if self.lost:
            yield f"the file is cut, and its last {self.lost} rows lack some channels: they are left out"
        if clock.duplicates > MOST_REPEATED * clock.samples:
            yield (
                f"{clock.duplicates} of {clock.samples} rows ({clock.duplicates / clock.samples:.0%}) repeat the one "
                "before in every channel used: the recorder ran faster than the robot's measurements"
            )
        if clock.jitter * clock.rate > MOST_JITTER:
            yield f"the time between samples varies by {clock.jitter * 1e3:.3g} ms around {1e3 / clock.rate:.3g} ms"
        if clock.longest_gap * clock.rate > GAP:
            gap = clock.longest_gap
            yield f"the longest time between samples is {gap:.3g} s, {gap * clock.rate:.1f} samples"
