"""Which channels of a TDMS file share a clock: that of their group's time stamps, or of their waveforms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from davinci_forces.logs.log import Channel, Clock
from davinci_forces.logs.names import unique
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
