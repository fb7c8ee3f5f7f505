"""Which channels of a TDMS file share a clock: that of their group's time stamps, or of their waveforms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from math import isfinite
from typing import Any, NamedTuple

from davinci_forces.logs.log import Channel, Clock, unique
from davinci_forces.logs.tdms.metadata import EPOCH
from davinci_forces.logs.tdms.walk import Region
from davinci_forces.logs.timeline import Timeline, together


@dataclass(frozen=True)
class Sampled:
    """A channel as its clock is looked for."""

    group: str
    samples: int
    is_stamps: bool
    timeline: Timeline | None


@dataclass(frozen=True)
class ClocksFound:
    """The channels with their clocks, and what the log says of its own."""

    channels: tuple[Channel, ...]
    clock: Clock | None = None
    time: str = ""
    made: dict[str, Timeline] = field(default_factory=dict)  # the derived channels of times


def clocks_of(channels: Sequence[Channel], sampled: Mapping[str, Sampled], ends_anywhere: bool) -> ClocksFound:
    """Find the clock of every channel; `ends_anywhere` says that the file was cut, so that lengths say nothing.

    The first clock is the log's own, unless there are channels without any: those must not be taken to have it.
    """
    of = _shared(channels, sampled, ends_anywhere)
    clocks = list(dict.fromkeys(of.values()))
    if not any(clocks):
        return ClocksFound(tuple(channels))
    own = clocks[0] if "" not in clocks else None
    named = dict(zip(clocks, _names(clocks, channels, sampled), strict=True))
    longest = _longest(of, sampled)
    made = {named[c]: longest[c] for c in clocks if c and not sampled[c].is_stamps}
    told = tuple(replace(c, time="" if of[c.name] in (own, "") else named[of[c.name]]) for c in channels)
    if own and named[own] in made and made[named[own]].is_uniform:
        timeline = made.pop(named[own])
        return ClocksFound(_with(told, made), Clock(timeline.step[0], timeline.start[0]), "", made)
    return ClocksFound(_with(told, made, own=named[own] if own else ""), None, named[own] if own else "", made)


def _with(channels: tuple[Channel, ...], made: Mapping[str, Timeline], own: str = "") -> tuple[Channel, ...]:
    times = (Channel(name, "s", "time", derived=True, time="" if name == own else name) for name in made)
    return (*channels, *times)


def _shared(channels: Sequence[Channel], sampled: Mapping[str, Sampled], ends_anywhere: bool) -> dict[str, str]:
    """By channel, the first channel that has its clock; "" where nothing tells of it."""
    stamps: dict[str, str] = {}
    for name, one in sampled.items():
        if one.is_stamps:
            stamps.setdefault(one.group, name)
    waves = {name: one.timeline for name, one in sampled.items() if one.timeline and one.group not in stamps}
    of = {name: group[0] for group in together(waves) for name in group}
    of |= {name: stamps[one.group] for name, one in sampled.items() if one.group in stamps}
    known = {name: of[name] for name in sampled if name in of}
    for channel in channels:
        if channel.name not in of:
            one = sampled[channel.name]
            fits = [n for n in known if ends_anywhere or sampled[n].samples == one.samples or not one.samples]
            near = [n for n in fits if sampled[n].group == one.group]
            of[channel.name] = known[(near or fits)[0]] if fits else ""
    return of


def _names(clocks: Sequence[str], channels: Sequence[Channel], sampled: Mapping[str, Sampled]) -> list[str]:
    """The channel of each clock: its time stamps, else one to be made, which no channel is called like."""
    made = ["" if not c or sampled[c].is_stamps else f"time of {c}" for c in clocks]
    if len(clocks) == 1:
        made = ["time" if name else "" for name in made]
    free = iter(unique([name for name in made if name], [channel.name for channel in channels]))
    return [next(free) if name else clock for name, clock in zip(made, clocks, strict=True)]


def _longest(of: Mapping[str, str], sampled: Mapping[str, Sampled]) -> dict[str, Timeline]:
    """The longest timeline of each clock."""
    longest: dict[str, Timeline] = {}
    for name, clock in of.items():
        timeline = sampled[name].timeline
        if timeline and (clock not in longest or timeline.rows > longest[clock].rows):
            longest[clock] = timeline
    return longest


class Words(NamedTuple):
    """What a file segment says of a channel's clock."""

    step: float  # [s] wf_increment
    offset: float  # [s] wf_start_offset: of the first sample from the start
    start: datetime | None  # wf_start_time, in UTC


@dataclass
class Waveforms:
    """The samples of each channel, and what was said of their clock when they were written."""

    writes: dict[str, list[tuple[int, Words | None]]] = field(default_factory=dict)

    def add(self, region: Region, properties: Mapping[str, Mapping[str, Any]]) -> None:
        """Take in a region, and the properties as they stand there."""
        for path, count in region.counts.items():
            writes = self.writes.setdefault(path, [])
            words = _words(properties.get(path, {}))
            if writes and writes[-1][1] == words:
                writes[-1] = writes[-1][0] + count * region.records, words
            else:
                writes.append((count * region.records, words))

    @property
    def started(self) -> datetime | None:
        """When the first channel started that says so."""
        every = (words.start for writes in self.writes.values() for _, words in writes if words and words.start)
        return next(every, None)

    def timelines(self, zero: datetime | None, properties: Mapping[str, Mapping[str, Any]]) -> dict[str, Timeline]:
        """By path, counted from `zero`; channels that nothing is said of have none.

        Properties may be written behind all samples; those before any was written have the first ones.
        """
        made = {}
        for path, writes in self.writes.items():
            first = next((words for _, words in writes if words), None) or _words(properties.get(path, {}))
            if first:
                made[path] = _timeline([(rows, words or first) for rows, words in writes], zero)
        return made


def _words(properties: Mapping[str, Any]) -> Words | None:
    step, offset, start = (properties.get(f"wf_{word}") for word in ("increment", "start_offset", "start_time"))
    if not isinstance(step, int | float) or not isfinite(step) or step <= 0:
        return None
    offset = offset if isinstance(offset, int | float) and isfinite(offset) else 0.0
    # LabVIEW writes the year 1904 where nobody said when.
    known = isinstance(start, datetime) and start != EPOCH
    return Words(float(step), float(offset), start if known else None)


def _timeline(writes: list[tuple[int, Words]], zero: datetime | None) -> Timeline:
    made, last = Timeline(), None
    for rows, words in writes:
        # The same start with another interval goes on from where the samples are.
        goes_on = last is not None and (last.start, last.offset) == (words.start, words.offset)
        since = (words.start - zero).total_seconds() if words.start and zero else 0.0
        made.add(rows, None if goes_on else since + words.offset, words.step)
        last = words
    return made
