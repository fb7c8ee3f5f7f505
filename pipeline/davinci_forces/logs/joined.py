"""Read signals that were recorded at the same time in separate files, and align channels of several clocks.

Channels are interpolated by cubics, never across a gap.  The error on a motion is proportional to the fourth power of
the sampling time; for straight lines, to its second power.  Cubics leave 64 to 100 % of the variance of white noise,
straight lines 50 to 100 %.  A channel sampled at least twice as fast as the clock is first low-passed without delay, so
that noise above the clock's Nyquist frequency is not aliased.  Clocks whose stamps agree within jitter are one clock.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from davinci_forces.logs.log import SAMPLED_KINDS, UNIT_OF_COUNTS, Block, Channel, Log, Options, row_count, unique
from davinci_forces.logs.parts import ABSOLUTE, require_different, starts_of
from davinci_forces.logs.timeline import SKEW
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals import clock as clocks

FILLED_IN = "\n"  # name in a block of the flags of rows in which a missing sample was filled in: 1, else 0
MIN_FLAG = 0.25  # an interpolated flag from which on a row is taken as filled in
MIN_RATIO_FILTERED = 1.9  # of the sampling rate of a channel to the clock's, above which it is low-passed
MIN_STAMPS_AGREEING = 10  # of two clocks, to compare them
MIN_SHARE_AGREEING = 0.95  # of stamps that agree with those of another clock, if both are one clock


def open_joined(files: Sequence[Path], options: Options) -> Log:
    """Open files that were recorded at the same time; raises BadLog if one cannot be read, or two are equal."""
    require_different(files)
    return Joined([open_log(file, options) for file in files])


class Joined(Log):
    """Logs recorded together, with channels `file/channel`; clocks count from the first start if all state theirs."""

    def __init__(self, parts: Sequence[Log]) -> None:
        first = parts[0]
        names = [part.path.name for part in parts]
        shown = ", ".join(names[:3]) + (" ..." if len(names) > 3 else "")
        super().__init__(
            first.path.parent / shown, first.format, (), started=first.started, zone=first.zone,
            facts={"joined": ", ".join(names), **first.facts}, cut=any(part.cut for part in parts),
        )  # fmt: skip
        self.parts = dict(zip(unique([Path(name.removesuffix(".gz")).stem for name in names]), parts, strict=True))
        self.lent = {f"{stem}/{n}": f"{stem}/{c}" for stem, part in self.parts.items() for n, c in part.lent.items()}
        starts = starts_of(parts)
        self.offsets = dict(zip(self.parts, starts or [0.0] * len(parts), strict=True))
        remark = "not all joined files say when they started; their clocks are assumed to have the same zero"
        self.remarks = [] if starts else [remark]
        self.of: dict[str, str] = {}  # the file of each channel
        self.counted: dict[str, str] = {}  # derived time channels, each with a channel of as many samples
        self.channels = tuple(channel for stem, part in self.parts.items() for channel in self._channels(stem, part))

    def _channels(self, stem: str, part: Log) -> Iterator[Channel]:
        counted = ""
        if not part.time and (sampled := [c.name for c in part.channels if not c.time and c.kind in SAMPLED_KINDS]):
            [name] = unique(["time" if part.clock else "sample"], [channel.name for channel in part.channels])
            counted = f"{stem}/{name}"
            self.of[counted], self.counted[counted] = stem, sampled[0]
            yield Channel(counted, "s" if part.clock else UNIT_OF_COUNTS, "time", derived=True, time=counted)
        for channel in part.channels:
            clock = channel.time or part.time
            time = f"{stem}/{clock}" if clock else counted
            self.of[f"{stem}/{channel.name}"] = stem
            alias = channel.alias and f"{stem}/{channel.alias}"
            yield Channel(f"{stem}/{channel.name}", channel.unit, channel.kind, channel.derived, time, alias)

    def times_called(self, name: str | int) -> list[Channel]:
        """List the time channels that a study means; a number means that column of each file."""
        if isinstance(name, str):
            return super().times_called(name)
        return [self.find(f"{stem}/{part.find(name).name}") for stem, part in self.parts.items()]

    def independent_copy(self) -> Self:
        """Copy the log and its files, to be read at the same time as this one."""
        twin = super().independent_copy()
        twin.parts = {stem: part.independent_copy() for stem, part in self.parts.items()}
        return twin

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        self.warnings[:] = self.remarks
        stem = self.of[names[0]]
        part = self.parts[stem]
        inner = {name: name.removeprefix(f"{stem}/") for name in names if name not in self.counted}
        rows = 0
        for block in part.blocks(list(inner.values()) or [self.counted[names[0]]]):
            count = row_count(block)
            number = rows + np.arange(count, dtype=np.float64)
            yield {
                name: self._since_start(stem, k, block[k]) if (k := inner.get(name)) else self._clock(stem, number)
                for name in names
            }
            rows += count
        self.warnings += [f"{part.path.name}: {warning}" for warning in part.warnings]
        self.comments += [f"{part.path.name}: {comment}" for comment in part.comments]
        self.dropped += part.dropped
        for name, inner_name in inner.items():
            self.nulls[name], self.nans[name] = part.nulls.get(inner_name, 0), part.nans.get(inner_name, 0)

    def _clock(self, stem: str, number: Array) -> Array:
        """Compute the sample times [s] of a file with a uniform clock, or the sample numbers without one."""
        clock = self.parts[stem].clock
        return clock.start + number * clock.step + self.offsets[stem] if clock else number

    def _since_start(self, stem: str, name: str, values: Array) -> Array:
        """Shift a time channel to count from the start of the first file; other samples stay as they are."""
        part = self.parts[stem]
        is_time = name == part.time or any(channel.time == name for channel in part.channels)
        counts_from_start = is_time and len(values) and not abs(values[0]) > ABSOLUTE
        return values + self.offsets[stem] if counts_from_start and self.offsets[stem] else values


TimedBlock = tuple[Array, Block]  # times (N,) [s], and samples (N,) by the names of their channels
Refuse = Callable[[str], BadLog]


@dataclass
class Alignment:
    """How channels of other clocks were aligned to one clock."""

    period: float = 0.0  # [s] median sampling time of the clock
    kept: int = 0  # rows
    left_out: int = 0  # rows before the latest start of a clock, after the earliest end, or in a gap
    others: dict[str, "Follower"] = field(default_factory=dict)

    @property
    def clocks_differ(self) -> bool:
        """Whether the clocks differed, so that rows were dropped, interpolated or averaged."""
        return bool(self.left_out) or any(f.interpolated or f.ratio > 1.0 for f in self.others.values())


def align(
    timed: Iterator[TimedBlock], others: dict[str, Iterator[TimedBlock]], done: Alignment, refuse: Refuse
) -> Iterator[TimedBlock]:
    """Align channels of other clocks to the rows of one clock; `done` records how.

    Rows that are not between samples of every other clock are left out.  Raises BadLog if times do not increase, clocks
    do not overlap, or one is far slower.
    """
    clock = clocks.ClockStatistics()
    for t, block in timed:
        if not len(t):
            continue
        _update(clock, t, "the positions", refuse)
        if not done.others:
            done.period = _period(t)
            done.others |= {name: Follower(name, source, done.period, refuse) for name, source in others.items()}
        keep, flags = np.ones(len(t), dtype=bool), block.pop(FILLED_IN, np.zeros(len(t)))
        for follower in done.others.values():
            samples, present, filled = follower.samples_at(t)
            keep &= present
            flags = np.maximum(flags, filled)
            block = block | samples
        block = block | {FILLED_IN: flags}
        done.kept += int(np.count_nonzero(keep))
        done.left_out += int(np.count_nonzero(~keep))
        yield t[keep], {name: values[keep] for name, values in block.items()}
    if done.others and not done.kept:
        compared = {"the positions runs": clock} | {name: follower.clock for name, follower in done.others.items()}
        spans = [f"of {whose} from {c.first:.6g} to {c.last:.6g} s" for whose, c in compared.items()]
        remedy = "record them together, or leave out the channels of one"
        raise refuse(f"the clock {', that '.join(spans)}: they do not overlap; {remedy}")


def _period(t: Array) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.0


def _update(clock: clocks.ClockStatistics, t: Array, whose: str, refuse: Refuse) -> None:
    """Add the next times to a clock, which must be finite and increase."""
    if not np.isfinite(t).all():
        row = clock.samples + int(np.flatnonzero(~np.isfinite(t))[0])
        raise refuse(f"the time of {whose} is not finite at row {row} (counted from 0); record it again")
    clock.update(t)
    if clock.backward or clock.repeated:
        where = f"at row {clock.bad_row} (counted from 0): {clock.bad_pair[0]:.9g} s, then {clock.bad_pair[1]:.9g} s"
        remedy = "leave these channels out, or set rate = ... [Hz] to count samples instead"
        raise refuse(f"the time of {whose} does not increase {where}; {remedy}")


class Follower:
    """Channels of another clock, interpolated to requested times; keeps only the samples around them."""

    def __init__(self, name: str, source: Iterator[TimedBlock], period: float, refuse: Refuse) -> None:
        self.name, self.source, self.refuse, self.clock = name, source, refuse, clocks.ClockStatistics()
        self.names: list[str] = []
        self.interpolated = 0  # interpolated rows
        self.ended = False
        self.t, self.x = np.empty(0), np.empty((0, 0))
        self.waiting = self.t, self.x, 0  # samples of the low-pass, and how many of them are done
        following = self._next()
        self.period = _period(following[0]) if following else 0.0  # [s] median sampling time
        if self.period > clocks.MAX_PERIOD_RATIO * period:
            pace = f"more than {clocks.MAX_PERIOD_RATIO:g} times as slow as the positions (every {period:.4g} s)"
            remedy = "too slow to interpolate; record it faster, or leave it out"
            raise refuse(f"{name} is sampled every {self.period:.4g} s, {pace}: {remedy}")
        ratio = period / self.period if self.period else 1.0
        self.ratio = ratio if ratio > MIN_RATIO_FILTERED else 1.0  # of sampling rates, if the faster is low-passed
        self.within = np.nan  # [s] distance of stamps that are the same; unknown before the first
        self._take(following)

    def samples_at(self, t: Array) -> tuple[Block, Booleans, Array]:
        """Interpolate at times (N,), which increase from call to call; also returns where samples exist and flags."""
        while not self.ended and not (len(self.t) > 1 and self.t[-2] > t[-1]):
            self._take(self._next())
        if np.isnan(self.within) and len(self.t):
            apart = clocks.distances(self.t, t[(t >= self.t[0]) & (t <= self.t[-1])]) > SKEW * self.period
            agree = len(apart) >= MIN_STAMPS_AGREEING and 1.0 - apart.mean() >= MIN_SHARE_AGREEING
            self.within = SKEW * self.period if agree else 0.0
        x, exact, between = clocks.cubic(self.t, self.x, clocks.longest_bridge(self.period), t, self.within)
        self.interpolated += int(np.count_nonzero(between))
        filled = between & clocks.are_missing(self.t, t, self.period)
        last = int(np.searchsorted(self.t, t[-1], side="right")) - 1
        begin = max(last - 1, 0)  # the slope at the last sample needs the sample before it
        self.t, self.x = self.t[begin:], self.x[begin:]
        samples = dict(zip(self.names, x.T, strict=True))
        return samples, exact | between, np.maximum(filled, samples.pop(FILLED_IN, filled) > MIN_FLAG)

    def _next(self) -> TimedBlock | None:
        following = next((timed for timed in self.source if len(timed[0])), None)
        self.ended = following is None
        if following:
            _update(self.clock, following[0], self.name, self.refuse)
        return following

    def _take(self, timed: TimedBlock | None) -> None:
        """Append samples to those kept, low-passed if there are too many of them."""
        if timed is not None:
            self.names = list(timed[1])
        t, x = (timed[0], np.column_stack(list(timed[1].values()))) if timed else (self.t[:0], self.x[:0])
        if self.ratio > 1.0:
            t, x = self._lowpassed(t, x)
        self.t, self.x = np.concatenate((self.t, t)), np.concatenate((self.x.reshape(-1, x.shape[1]), x))

    def _lowpassed(self, t: Array, x: Array) -> tuple[Array, Array]:
        """Low-pass the samples (N, C) that wait and are followed by enough others, or by the end, between gaps."""
        before_t, before_x, done = self.waiting
        t, x = np.concatenate((before_t, t)), np.concatenate((before_x.reshape(-1, x.shape[1]), x))
        reach = clocks.half_width(self.ratio)
        ready = len(t) if self.ended else max(len(t) - reach, done)
        starts = np.flatnonzero(clocks.are_gaps(t, self.period)) + 1
        between_gaps = (part for part in np.split(x, starts) if len(part))
        smooth = np.concatenate([x[:0], *(clocks.flat_lowpass(part, self.ratio) for part in between_gaps)])
        begin = max(ready - reach, 0)
        self.waiting = t[begin:], x[begin:], ready - begin
        return t[done:ready], smooth[done:ready]
