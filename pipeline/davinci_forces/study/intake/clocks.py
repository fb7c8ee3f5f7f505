"""Find the time channels of the channels that a study uses, and compute their times in seconds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from davinci_forces.logs.joined import Alignment, Follower, TimedBlock, align
from davinci_forces.logs.log import UNIT_OF_COUNTS, Block, Log, row_count
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.units import since_1970
from davinci_forces.maths.units import size as size_of
from davinci_forces.study import LogEntry
from davinci_forces.study.intake.missing import MissingSamples, split_by_rhythm, without_empty_rows

MAX_SECONDS = 1e11  # [s] a later time since 1970 is in a smaller unit
ALIGNED = ""  # name in a block of the times of channels that were resampled on one clock [s]


@dataclass(frozen=True)
class ClockGroup:
    """Channels of one clock, and the channel of their times; "" where samples are counted."""

    names: tuple[str, ...]
    time: str
    is_stated: bool  # the study names this channel
    has_empty_rows: bool = False  # their table has rows of other channels, in which these have no samples


@dataclass
class UsedClocks:
    """The clocks of the channels that a study uses; `scale` is the size of its unit of time in SI."""

    log: Log
    entry: LogEntry
    scale: float
    used: Sequence[str]  # channels of quantities
    reference: str  # the channel on whose clock all others are resampled
    done: Alignment = field(default_factory=Alignment)
    missing: MissingSamples = field(default_factory=MissingSamples)
    units: dict[str, float] = field(default_factory=dict)  # by time channel, its unit since 1970 [s]

    def __post_init__(self) -> None:
        self.time_source = next((source for source in self.entry.channels if source.quantity == "time"), None)
        groups = [part for time, names in self.log.by_clock(self.used).items() for part in self._split(time, names)]
        if self.time_source and not any(group.is_stated for group in groups):
            why = f"time = {self.time_source.channel!r} is not the clock of any channel that is used"
            raise self.log.bad(f"{why}; the log has a clock for these, so leave time out of [log.channels]")
        self.groups = sorted(groups, key=lambda group: self.reference not in group.names)
        self.missing.until = np.inf if self.entry.until is None else self.entry.until
        lent = self.log.lent  # the clock of a channel that is not used is not that of those that are
        for group in () if self.entry.rate else self.groups:
            names = [self.log.find(name).name for name in group.names]
            if not group.is_stated and all(name in lent and lent[name] not in names for name in names):
                lender = f"only of {lent[names[0]]!r}, which is not used"
                remedy = "give rate = ... [Hz], or name its time in [log.channels]"
                raise self.log.bad(f"the log states no sampling time of channel {names[0]!r}, {lender}; {remedy}")

    @property
    def are_several(self) -> bool:
        """Whether channels have to be resampled on one clock."""
        return len(self.groups) > 1

    @property
    def all_timed(self) -> bool:
        """Whether every clock gives times in seconds."""
        return all(map(self._is_known, self.groups))

    @property
    def time(self) -> str:
        """The channel of times of all channels, or ""."""
        return self.groups[0].time if not self.are_several else ""

    def _is_known(self, group: ClockGroup) -> bool:
        log_time = next(iter(self.log.by_clock(group.names)))
        if group.time and not group.is_stated and self.log.find(group.time).unit == UNIT_OF_COUNTS:
            return False
        return bool(group.time or self.entry.rate or (self.log.clock and not log_time))

    def _split(self, log_time: str, names: Sequence[str]) -> Iterator[ClockGroup]:
        """Split channels of one clock of the log by the channels of times that the study names."""
        meant = self.log.times_called(self.time_source.channel) if self.time_source else []
        stated_times = [channel.name for channel in meant if log_time in self.log.by_clock([channel.name])]
        if not stated_times:
            yield ClockGroup(tuple(names), "" if self.entry.rate else log_time or self.log.time, is_stated=False)
            return
        by_time: dict[str, list[str]] = {}
        for name in names:
            same_group = (time for time in stated_times if time.rpartition("/")[0] == name.rpartition("/")[0])
            by_time.setdefault(next(same_group, stated_times[0]), []).append(name)
        for time, members in by_time.items():
            yield ClockGroup(tuple(members), time, is_stated=True)

    def blocks(self) -> Iterator[Block]:
        """The samples of all channels, on one clock where there are several, with `FILLED_IN`."""
        if not self.are_several:
            read = self._timed(self.log, self.groups[0])
            opening = next(read, None)
            rhythms = split_by_rhythm(*opening, self.groups[0].names) if opening else []
            read = chain([opening] if opening else [], read)
            if rhythms:
                groups = [replace(self.groups[0], names=names, has_empty_rows=True) for names in rhythms]
                self.groups = sorted(groups, key=lambda group: self.reference not in group.names)
                del opening  # the log is read again, one clock after the other
                read = self._timed(self.log, self.groups[0])
            if not self.are_several:  # with times where rows that are left out would spoil a count
                for t, block in self._filled(read, self.groups[0]):
                    yield block if self.groups[0].time else block | {ALIGNED: t}
                return
        if not self.all_timed:
            without = next(group for group in self.groups if not self._is_known(group))
            why = f"channel {without.names[0]!r} has no clock, but other channels that are used have clocks"
            remedy = "name its time in [log.channels], give rate = ... [Hz] for all channels, or leave it out"
            raise self.log.bad(f"{why}; {remedy}")
        logs = [self.log.independent_copy() for _ in self.groups]
        timed = (self._timed(log, group) for log, group in zip(logs, self.groups, strict=True))
        first, *others = (self._filled(blocks, group) for blocks, group in zip(timed, self.groups, strict=True))
        followers = {_listed(group.names): follower for group, follower in zip(self.groups[1:], others, strict=True)}
        try:
            for t, block in align(first, followers, self.done, self.log.bad):
                yield block | {ALIGNED: t}
        finally:
            for log in logs:
                self.log.remember(log.warnings, log.comments)
                self.log.nulls, self.log.nans = self.log.nulls | log.nulls, self.log.nans | log.nans
                self.log.dropped = max(self.log.dropped, log.dropped)

    def _filled(self, timed: Iterator[TimedBlock], group: ClockGroup) -> Iterator[TimedBlock]:
        """Fill short runs of missing samples, and leave out the rows of longer ones."""
        timed = without_empty_rows(timed, group.names) if group.has_empty_rows else timed
        filled = self.missing.without_missing(timed, group.names)
        return ((t, {k: x for k, x in b.items() if k != group.time}) for t, b in filled) if self.are_several else filled

    def _timed(self, log: Log, group: ClockGroup) -> Iterator[TimedBlock]:
        rows = 0
        for block in log.blocks(list(dict.fromkeys((*group.names, *([group.time] if group.time else []))))):
            yield self.times(block, rows, group), block
            rows += row_count(block)

    def times(self, block: Block, rows: int, group: ClockGroup | None = None) -> Array:
        """Times [s] of a block after `rows` others: by the study's channel or rate, else by the log, else numbers."""
        if ALIGNED in block:
            return block[ALIGNED]
        group = group or self.groups[0]
        number = rows + np.arange(row_count(block))
        if group.is_stated and self.time_source:
            t = (block[group.time] + self.time_source.offset) * (self.time_source.sign * self.scale)
            return t * self._since_1970(group.time, t)
        if self.entry.rate:
            return number / self.entry.rate
        if group.time:
            return block[group.time] * self._since_1970(group.time, block[group.time])
        if self.log.clock is None:
            return number.astype(np.float64)
        return np.asarray(self.log.clock.start + number * self.log.clock.step, dtype=np.float64)

    def _since_1970(self, name: str, t: Array) -> float:
        """The size [s] of ms, us or ns if times since 1970 are in it, but taken as seconds; else 1.

        Raises BadLog if no unit of time gives a date, or the study or the log states the unit.
        """
        if name not in self.units and len(t):
            size = float(np.median(np.abs(t)))
            unit = since_1970(size) if MAX_SECONDS < size < np.inf else "s"
            stated = self.log.find(name).unit or (self.time_source.unit if self.time_source else "")
            if not unit or (unit != "s" and stated):
                why = f"channel {name!r} holds times of {size:.4g} s, which is no date"
                raise self.log.bad(f"{why}; correct the unit of time in study.toml, or name another time channel")
            self.units[name] = size_of(unit)
        return self.units.get(name, 1.0)

    def note(self) -> Iterator[str]:
        """Notes on how times were read, and on how channels were resampled on one clock."""
        done, name = self.done, self.entry.name
        for channel, unit in self.units.items():
            if unit != 1.0:
                yield f"{name}: the times in {channel!r} are read in units of {unit:g} s since 1970, not in seconds"
        if not done.clocks_differ:
            return
        how = "; ".join(_how(follower_name, follower) for follower_name, follower in done.others.items())
        clock = f"the clock of {_listed(self.groups[0].names)} ({1 / done.period:.6g} Hz)"
        yield f"{name}: channels with different clocks were resampled on {clock}: {how}"
        if done.left_out:
            rows = f"{done.left_out} of {done.kept + done.left_out} rows are left out"
            yield f"{name}: {rows}, because another clock has no samples near enough on both sides"


def _how(name: str, follower: Follower) -> str:
    rate = f"{name} ({1 / follower.period:.6g} Hz)" if follower.period else name
    if not follower.interpolated and follower.ratio == 1.0:
        return f"{rate} has the same times"
    filtered = "low-passed without delay and " if follower.ratio > 1.0 else ""
    return f"{rate} was {filtered}interpolated by cubics between neighbours, but not across gaps"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(repr(name) for name in names[:4]) + (" ..." if len(names) > 4 else "")
