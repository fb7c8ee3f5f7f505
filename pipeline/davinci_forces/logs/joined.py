"""A log whose signals were recorded into files of their own, read side by side.

Channels of several clocks put on one of them, without bridging a gap.

They are interpolated by cubics: of a motion these are wrong by the fourth power of the sampling time, where straight
lines are by the second, and of white noise they leave 64 to 100 % of the variance, where straight lines leave 50 to
100 %.  A channel that is sampled at least twice as fast as the clock is averaged over its sampling time first, so that
noise above what that clock can show does not fold into it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from davinci_forces.logs.log import COUNTED, Block, Channel, Log, Options, unique
from davinci_forces.logs.parts import ABSOLUTE, SAMPLED, require_different, starts_of
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.clock import GAP, ClockStatistics, cubic, means

SLOWEST = 10.0  # times the sampling time of the clock, beyond which a channel says too little between its samples


def open_joined(files: Sequence[Path], options: Options) -> Log:
    """Open files that were recorded at the same time.

    Raises
    ------
    BadLog
        If one cannot be read, or is there twice.
    """
    require_different(files)
    return Joined([open_log(file, options) for file in files])


class Joined(Log):
    """Several logs side by side, each with its own clocks; a channel is called `file/channel`.

    The clocks count from when the first file started, where all say when they did, else from one zero.
    """

    def __init__(self, parts: Sequence[Log]) -> None:
        first = parts[0]
        names = [part.path.name for part in parts]
        shown = ", ".join(names[:3]) + (" ..." if len(names) > 3 else "")
        super().__init__(
            first.path.parent / shown, first.format, (), started=first.started, zone=first.zone,
            facts={"joined": ", ".join(names), **first.facts}, cut=any(part.cut for part in parts),
        )  # fmt: skip
        self.parts = dict(zip(unique([Path(name.removesuffix(".gz")).stem for name in names]), parts, strict=True))
        starts = starts_of(parts)
        self.offsets = dict.fromkeys(self.parts, 0.0)
        if starts:
            since = ((start - starts[0]).total_seconds() for start in starts)
            self.offsets = dict(zip(self.parts, since, strict=True))
        self.remarks = [] if starts else [
            "the joined files do not all say when they started: their clocks are taken to count from one zero"
        ]  # fmt: skip
        self.of: dict[str, str] = {}  # the file of each channel
        self.counted: dict[str, str] = {}  # channels of times that are made, with one that has as many samples
        self.channels = tuple(channel for stem, part in self.parts.items() for channel in self._channels(stem, part))

    def _channels(self, stem: str, part: Log) -> Iterator[Channel]:
        counted = ""
        if not part.time and (sampled := [c.name for c in part.channels if not c.time and c.kind in SAMPLED]):
            [name] = unique(["time" if part.clock else "sample"], [channel.name for channel in part.channels])
            counted = f"{stem}/{name}"
            self.of[counted], self.counted[counted] = stem, sampled[0]
            yield Channel(counted, "s" if part.clock else COUNTED, "time", derived=True, time=counted)
        for channel in part.channels:
            own = channel.time or part.time
            time = f"{stem}/{own}" if own else counted
            self.of[f"{stem}/{channel.name}"] = stem
            alias = channel.alias and f"{stem}/{channel.alias}"
            yield Channel(f"{stem}/{channel.name}", channel.unit, channel.kind, channel.derived, time, alias)

    def times_called(self, name: str | int) -> list[Channel]:
        """The times that a study means: by a number, that column of each file."""
        if isinstance(name, str):
            return super().times_called(name)
        return [self.find(f"{stem}/{part.find(name).name}") for stem, part in self.parts.items()]

    def apart(self) -> "Joined":
        """The same, with files that are read apart, too."""
        other = super().apart()
        assert isinstance(other, Joined)
        other.parts = {stem: part.apart() for stem, part in self.parts.items()}
        return other

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the channels, which are of one file because they are of one clock."""
        self._start_anew(names, kinds=SAMPLED)
        self.warnings[:] = self.remarks
        stem = self.of[names[0]]
        part = self.parts[stem]
        own = {name: name.removeprefix(f"{stem}/") for name in names if name not in self.counted}
        rows = 0
        for block in part.blocks(list(own.values()) or [self.counted[names[0]]]):
            count = len(next(iter(block.values())))
            number = rows + np.arange(count, dtype=np.float64)
            yield {
                name: self._since_start(stem, own[name], block[own[name]]) if name in own else self._clock(stem, number)
                for name in names
            }
            rows += count
        self.warnings += [f"{part.path.name}: {warning}" for warning in part.warnings]
        self.comments += [f"{part.path.name}: {comment}" for comment in part.comments]
        self.dropped += part.dropped
        for name, its in own.items():
            self.nulls[name], self.nans[name] = part.nulls.get(its, 0), part.nans.get(its, 0)

    def _clock(self, stem: str, number: Array) -> Array:
        """Times of the samples of a file that counts them [s], or their numbers."""
        clock = self.parts[stem].clock
        return clock.start + number * clock.step + self.offsets[stem] if clock else number

    def _since_start(self, stem: str, name: str, values: Array) -> Array:
        """The samples of a channel; its file's own times are counted from when the first file started."""
        part = self.parts[stem]
        is_time = name == part.time or any(channel.time == name for channel in part.channels)
        counts_from_start = is_time and len(values) and not abs(values[0]) > ABSOLUTE
        return values + self.offsets[stem] if counts_from_start and self.offsets[stem] else values


Timed = tuple[Array, Block]  # times (N,) [s], and samples (N,) by the names of their channels
Refuse = Callable[[str], BadLog]


@dataclass
class Alignment:
    """What was done to put channels of other clocks on one."""

    period: float = 0.0  # [s] median sampling time of the clock
    kept: int = 0  # rows
    left_out: int = 0  # rows before the last clock begins, after the first one ends, or in a gap of one
    others: dict[str, "Follower"] = field(default_factory=dict)

    @property
    def changed(self) -> bool:
        """Whether the clocks were not the same to begin with."""
        return bool(self.left_out) or any(each.interpolated or each.many > 1 for each in self.others.values())


def aligned(
    timed: Iterator[Timed], others: dict[str, Iterator[Timed]], done: Alignment, refuse: Refuse
) -> Iterator[Timed]:
    """Consecutive rows of one clock with the samples of all others at their times; `done` says how.

    Rows for which another clock has no samples on either side are left out.

    Raises
    ------
    BadLog
        If a time stands still or goes back, clocks do not overlap, or one is far slower.
    """
    own = _Rising("the positions", refuse)
    for t, block in timed:
        if not len(t):
            continue
        own.update(t)
        if not done.others:
            done.period = _period(t)
            done.others |= {name: Follower(name, source, done.period, refuse) for name, source in others.items()}
        keep = np.ones(len(t), dtype=bool)
        for follower in done.others.values():
            samples, known = follower.at(t)
            keep &= known
            block = block | samples
        done.kept += int(np.count_nonzero(keep))
        done.left_out += int(np.count_nonzero(~keep))
        yield t[keep], {name: values[keep] for name, values in block.items()}
    if done.others and not done.kept:
        spans = (f"that of {name} {each.rising.span}" for name, each in done.others.items())
        raise refuse(
            f"the clock of the positions runs {own.span}, {', '.join(spans)}: they have no time in common; record them "
            "together, or leave out the channels of one"
        )


def _period(t: Array) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.0


@dataclass
class _Rising:
    """A clock that has to rise."""

    whose: str
    refuse: Refuse
    statistics: ClockStatistics = field(default_factory=ClockStatistics)

    def update(self, t: Array) -> None:
        """Take in the next times."""
        clock = self.statistics
        if not np.isfinite(t).all():
            row = clock.samples + int(np.flatnonzero(~np.isfinite(t))[0])
            raise self.refuse(f"the time of {self.whose} is no number at row {row} (counted from 0); record it again")
        clock.update(t)
        if clock.backward or clock.repeated:
            raise self.refuse(
                f"the time of {self.whose} does not increase at row {clock.bad_row} (counted from 0): "
                f"{clock.bad_pair[0]:.9g} s, then {clock.bad_pair[1]:.9g} s; leave these channels out, or say "
                "rate = ... [Hz] to count samples instead"
            )

    @property
    def span(self) -> str:
        """From when to when it ran, as far as it was read."""
        return f"from {self.statistics.first:.6g} to {self.statistics.last:.6g} s"


class Follower:
    """The channels of another clock: the samples around the times that are asked for."""

    def __init__(self, name: str, source: Iterator[Timed], period: float, refuse: Refuse) -> None:
        self.source, self.rising = source, _Rising(name, refuse)
        self.names: list[str] = []
        self.interpolated = 0  # rows that lie between samples
        self.many, self.ended = 1, False  # samples that are averaged into one
        self.t, self.x = np.empty(0), np.empty((0, 0))
        self.waiting = self.t, self.x  # too few to be averaged yet
        following = self._next()
        self.period = _period(following[0]) if following else 0.0  # [s] median sampling time
        if self.period > SLOWEST * period:
            raise refuse(
                f"{name} is sampled every {self.period:.4g} s and the positions every {period:.4g} s: what goes on in "
                f"more than {SLOWEST:g} samples of these is not known; record it faster, or leave it out"
            )
        self.many = max(1, int(period / self.period + 0.1)) if self.period else 1
        self.gap = GAP * self.period
        self._take(following)

    def at(self, t: Array) -> tuple[Block, Booleans]:
        """The samples at times (N,) that rise from call to call, and where there are any."""
        while not self.ended and not (len(self.t) > 1 and self.t[-2] > t[-1]):
            self._take(self._next())
        x, exact, between = cubic(self.t, self.x, self.gap * self.many, t)
        self.interpolated += int(np.count_nonzero(between))
        last = int(np.searchsorted(self.t, t[-1], side="right")) - 1
        begin = max(last - 1, 0)  # the slope at the last sample needs the one before
        self.t, self.x = self.t[begin:], self.x[begin:]
        return dict(zip(self.names, x.T, strict=True)), exact | between

    def _next(self) -> Timed | None:
        following = next((timed for timed in self.source if len(timed[0])), None)
        self.ended = following is None
        if following:
            self.rising.update(following[0])
        return following

    def _take(self, timed: Timed | None) -> None:
        """Add samples to those that are there."""
        if timed is None:
            return
        self.names = list(timed[1])
        t, x = timed[0], np.column_stack(list(timed[1].values()))
        if self.many > 1:
            t, x = self._averaged(t, x)
        self.t, self.x = np.concatenate((self.t, t)), np.concatenate((self.x.reshape(-1, x.shape[1]), x))

    def _averaged(self, t: Array, x: Array) -> tuple[Array, Array]:
        t, x = np.concatenate((self.waiting[0], t)), np.concatenate((self.waiting[1].reshape(-1, x.shape[1]), x))
        fewer, mean, left = means(t, x, self.many, self.gap)
        self.waiting = t[len(t) - left :], x[len(x) - left :]
        return fewer, mean
