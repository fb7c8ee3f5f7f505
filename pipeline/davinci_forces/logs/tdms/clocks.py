"""Find which channels of a TDMS file share a clock: their group's time stamps, or equal waveform properties."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from math import isfinite
from typing import Any, NamedTuple

from davinci_forces.logs.log import Channel, Clock, Log, unique
from davinci_forces.logs.tdms.metadata import EPOCH
from davinci_forces.logs.tdms.walk import Region
from davinci_forces.logs.timeline import Timeline, group_by_clock


@dataclass(frozen=True)
class Sampled:
    """What the search for clocks needs to know of a channel."""

    group: str
    samples: int
    is_stamps: bool
    timeline: Timeline | None


def set_clocks(log: Log, sampled: Mapping[str, Sampled]) -> dict[str, Timeline]:
    """Set the clocks of a log and of its channels, and return the derived time channels by name."""
    clock_of = _shared(log.channels, sampled, log.cut)
    clocks = list(dict.fromkeys(clock_of.values()))
    if not any(clocks):
        return {}
    log.lent = {n: c for n, c in clock_of.items() if c and sampled[c].timeline and not sampled[n].timeline}
    named = dict(zip(clocks, _names(clocks, log.channels, sampled), strict=True))
    timed = [(timeline, clock) for name, clock in clock_of.items() if (timeline := sampled[name].timeline)]
    timed.sort(key=lambda pair: -pair[0].rows)
    longest = {clock: timeline for timeline, clock in reversed(timed)}  # of equally long ones the first
    derived = {named[c]: longest[c] for c in clocks if c and not sampled[c].is_stamps}
    main = clocks[0] if "" not in clocks else ""  # of the log; channels without a clock would wrongly inherit it
    log.time = named[main] if main else ""
    if log.time in derived and len(derived[log.time].first) == 1:
        timeline = derived.pop(log.time)
        log.time, log.clock = "", Clock(timeline.step[0], timeline.start[0])
    times = {name: "" if clock in (main, "") else named[clock] for name, clock in clock_of.items()}
    added = (Channel(name, "s", "time", derived=True, time="" if name == log.time else name) for name in derived)
    log.channels = (*(replace(channel, time=times[channel.name]) for channel in log.channels), *added)
    return derived


def _shared(channels: Sequence[Channel], sampled: Mapping[str, Sampled], ends_anywhere: bool) -> dict[str, str]:
    """Map each channel to the first on its clock, "" if unknown; lengths prove nothing if the file `ends_anywhere`."""
    stamps: dict[str, str] = {}
    for name, s in sampled.items():
        if s.is_stamps:
            stamps.setdefault(s.group, name)
    waves = {name: s.timeline for name, s in sampled.items() if s.timeline and s.group not in stamps}
    clock_of = {name: group[0] for group in group_by_clock(waves) for name in group}
    clock_of |= {name: stamps[s.group] for name, s in sampled.items() if s.group in stamps}
    clocked = {name: clock_of[name] for name in sampled if name in clock_of}
    for channel in channels:
        if channel.name not in clock_of:
            s = sampled[channel.name]
            fits = [n for n in clocked if ends_anywhere or sampled[n].samples == s.samples or not s.samples]
            near = [n for n in fits if sampled[n].group == s.group]
            clock_of[channel.name] = clocked[(near or fits)[0]] if fits else ""
    return clock_of


def _names(clocks: Sequence[str], channels: Sequence[Channel], sampled: Mapping[str, Sampled]) -> list[str]:
    """Name the time channel of each clock: its time stamps, else a derived one with an unused name."""
    names = ["" if not c or sampled[c].is_stamps else f"time of {c}" for c in clocks]
    if len(clocks) == 1:
        names = ["time" if name else "" for name in names]
    free = iter(unique([name for name in names if name], [channel.name for channel in channels]))
    return [next(free) if name else clock for name, clock in zip(names, clocks, strict=True)]


class Words(NamedTuple):
    """Waveform properties of a channel in a file segment."""

    step: float  # [s] wf_increment
    offset: float  # [s] wf_start_offset: from the start to the first sample
    start: datetime | None  # wf_start_time, in UTC


@dataclass
class Waveforms:
    """The numbers of samples of each channel, with the waveform properties at the time of writing."""

    writes: dict[str, list[tuple[int, Words | None]]] = field(default_factory=dict)

    def add(self, region: Region, properties: Mapping[str, Mapping[str, Any]]) -> None:
        """Add a region with the properties that hold there."""
        for path, count in region.counts.items():
            writes = self.writes.setdefault(path, [])
            words = _words(properties.get(path, {}))
            if writes and writes[-1][1] == words:
                writes[-1] = writes[-1][0] + count * region.records, words
            else:
                writes.append((count * region.records, words))

    def timelines(self, zero: datetime | None, properties: Mapping[str, Mapping[str, Any]]) -> dict[str, Timeline]:
        """Compute the timelines by path, counted from `zero`, where timed; the first properties hold from the start."""
        timelines = {}
        for path, writes in self.writes.items():
            first = next((words for _, words in writes if words), None) or _words(properties.get(path, {}))
            if not first:
                continue
            timelines[path], last = Timeline(), None
            for rows, stated in writes:
                words = stated or first
                # The same start with another interval continues from the samples before.
                goes_on = last is not None and (last.start, last.offset) == (words.start, words.offset)
                since = (words.start - zero).total_seconds() if words.start and zero else 0.0
                timelines[path].add(rows, None if goes_on else since + words.offset, words.step)
                last = words
        return timelines


def _words(properties: Mapping[str, Any]) -> Words | None:
    step, offset, start = (properties.get(f"wf_{word}") for word in ("increment", "start_offset", "start_time"))
    if not isinstance(step, int | float) or not isfinite(step) or step <= 0:
        return None
    offset = offset if isinstance(offset, int | float) and isfinite(offset) else 0.0
    # LabVIEW writes the year 1904 for an unknown start.
    is_stated = isinstance(start, datetime) and start != EPOCH
    return Words(float(step), float(offset), start if is_stated else None)
