"""A log that was recorded into several files, read as one: each is placed by when it started."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from filecmp import cmp
from itertools import pairwise
from pathlib import Path

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from davinci_forces.logs.log import Block, Channel, Log, Options, unique
from davinci_forces.logs.text.stamps import REMARK, clocks_may_change
from davinci_forces.logs.timeline import Timeline
from davinci_forces.maths.arrays import Array

NOBODY_SAID = datetime(1904, 1, 1)  # LabVIEW's zero, which it writes for a start that it was not told
ABSOLUTE = 1e9  # [s] a time beyond this counts from a year, not from the start of its part
SAMPLED = ("number", "time")


def open_parts(files: Sequence[Path], options: Options) -> Log:
    """Open the files of a log, in order.

    Raises
    ------
    BadLog
        If one cannot be read, has other channels than the first, is there twice, or started before the one before.
    """
    require_different(files)
    opened = [open_log(file, options) for file in files]
    return opened[0] if len(opened) == 1 else Parts(opened)


def require_different(files: Sequence[Path]) -> None:
    """Refuse a file that is given twice, or beside a copy of itself."""
    sizes: dict[int, list[Path]] = {}
    for file in filter(Path.is_file, files):
        of_its_size = sizes.setdefault(file.stat().st_size, [])
        for other in of_its_size:
            if file.samefile(other) or cmp(file, other, shallow=False):
                raise BadLog(f"{file}: it holds the same bytes as {other.name}; name every part of a log once")
        of_its_size.append(file)


class Parts(Log):
    """Several logs of the same channels, one after the other.

    The times of a part are its own, counted from when it started.  A time axis that a file writes and that goes on
    from part to part is left as it is.  Where parts do not say when they started, samples are counted on.
    """

    def __init__(self, parts: Sequence[Log]) -> None:
        first = parts[0]
        super().__init__(first.path, first.format, first.channels, first.clock, first.time, first.started, first.zone)
        self.parts = list(parts)
        for part in parts[1:]:
            if _written(part) != _written(first):
                raise BadLog(f"{part.path}: its channels are not those of {first.path}, so they are not one log")
        self.facts = {"parts": ", ".join(part.path.name for part in parts), **first.facts}
        self.cut = parts[-1].cut
        self.starts = starts_of(parts)
        self.remarks: list[str] = []
        if self.starts:
            self._place()
        elif first.clock:
            self.remarks.append(
                "the parts do not all say when they started: the samples of each are taken to follow directly on those "
                "of the one before"
            )

    def _place(self) -> None:
        """Give every clock of the parts a channel of times, and look at the starts."""
        _require_order(self.parts, self.starts)
        for one, other in pairwise(self.parts):
            if one.zone == "local" and clocks_may_change(one.started, other.started):
                self.remarks.append(f"{other.path.name} started after {one.path.name}, and {REMARK}")
        shared = _partition(self.parts[0])
        if any(_partition(part).keys() != shared.keys() for part in self.parts):
            raise BadLog(
                f"{self.path}: the parts of this log do not have the same channels on one clock; give each as a log "
                "of its own"
            )
        written = [channel for channel in self.channels if not (channel.derived and channel.kind == "time")]
        self.times: dict[str, frozenset[str]] = {}  # by the channel of times, the channels of that clock
        names = [channel.name for channel in written]
        for together in shared:
            clocks = [_partition(part)[together] for part in self.parts]
            if not all(own or part.clock for own, part in zip(clocks, self.parts, strict=True)):
                continue  # nobody knows when they were sampled
            own = clocks[0] if len(set(clocks)) == 1 and clocks[0] in names else ""
            made = clocks[0] if clocks[0] not in names else ""
            [time] = [own] if own else unique([made or "time"], [*names, *self.times])
            self.times[time] = together
        clocks_of_first = ((time, self.parts[0].by_clock(sorted(of)[:1])) for time, of in self.times.items())
        main = next((time for time, clock in clocks_of_first if "" in clock), "")
        self.clock, self.time = None, main
        of = {name: time for time, together in self.times.items() for name in together}
        told = (replace(c, time="" if of.get(c.name, main) == main else of[c.name]) for c in written)
        new = (Channel(t, "s", "time", True, "" if t == main else t) for t in self.times if t not in names)
        self.channels = (*told, *new)

    def apart(self) -> "Parts":
        """The same, with parts that are read apart, too."""
        other = super().apart()
        assert isinstance(other, Parts)
        other.parts = [part.apart() for part in self.parts]
        return other

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the parts in order; what they noticed is put together.

        Raises
        ------
        BadLog
            Where a part begins before the one before has ended.
        """
        self._start_anew(names, kinds=SAMPLED)
        self.warnings[:] = self.remarks
        asked = next((time for time in names if self.starts and time in self.times), "")
        axis = _Axis(self.parts, self.starts)
        for number, part in enumerate(self.parts):
            if not asked:
                yield from part.blocks(names)
            else:
                yield from self._placed(axis, number, part, names, asked)
            self.warnings += part.warnings
            self.comments += part.comments
            self.dropped += part.dropped
            for counts, own in ((self.nulls, part.nulls), (self.nans, part.nans)):
                for name, count in own.items():
                    counts[name] = counts.get(name, 0) + count

    def _placed(self, axis: "_Axis", number: int, part: Log, names: Sequence[str], time: str) -> Iterator[Block]:
        """The blocks of a part with their times on the axis of all."""
        together = self.times[time]
        own = _partition(part)[together]
        others = [name for name in names if name != time]
        counted = [] if own or others else sorted(together)[:1]  # something has to say how many samples there are
        for block in part.blocks([*others, *([own] if own else []), *counted]):
            count = len(next(iter(block.values())))
            t = axis.counted(number, part, count) if not own else axis.read(number, part, own, block[own])
            yield {name: t if name == time else block[name] for name in names}


def _written(log: Log) -> list[tuple[str, str, str]]:
    return [
        (c.name, c.unit, c.kind) for c in log.channels if not (c.derived and c.kind == "time") and c.name != "elapsed"
    ]


def _partition(log: Log) -> dict[frozenset[str], str]:
    """The channels of each clock of a log, with the channel of their times; "" for a clock that counts samples."""
    sampled = [c.name for c in log.channels if c.kind in SAMPLED and not c.derived]
    groups = log.by_clock(sampled)
    return {frozenset(names): own or log.time for own, names in groups.items()}


def starts_of(parts: Sequence[Log]) -> list[datetime]:
    """When the parts started; empty where not all say so in the same kind of time."""
    said = [part.started for part in parts]
    if not all(said) or len({part.zone for part in parts}) > 1:
        return []
    starts = [datetime.fromisoformat(each) for each in said]
    clocked = all(part.time or part.clock or any(channel.time for channel in part.channels) for part in parts)
    return starts if clocked and NOBODY_SAID not in starts else []


def _require_order(parts: Sequence[Log], starts: Sequence[datetime]) -> None:
    if all(before <= after for before, after in pairwise(starts)):
        return
    right = sorted(range(len(parts)), key=lambda i: starts[i])
    names = ", ".join(f'"{parts[i].path.name}"' for i in right)
    wrong = next(i for i, (before, after) in enumerate(pairwise(starts), start=1) if after < before)
    raise BadLog(
        f"{parts[wrong].path}: it started at {parts[wrong].started}, before {parts[wrong - 1].path.name} did, at "
        f"{parts[wrong - 1].started}; name the parts in this order: files = [{names}]"
    )


@dataclass
class _Axis:
    """The times of one clock, part after part."""

    parts: Sequence[Log]
    starts: Sequence[datetime]
    timeline: Timeline = field(default_factory=Timeline)  # of parts that count samples
    part: int = -1
    offset: float = 0.0  # [s] of the part's own times
    last: float = -np.inf  # [s] time before
    last_read: float = -np.inf  # the same as the part has it

    def counted(self, number: int, part: Log, count: int) -> Array:
        """Times of the next samples of a part that counts them."""
        assert part.clock is not None
        new = number != self.part
        self.timeline.add(0, self._since(number) + part.clock.start if new else None, part.clock.step)
        t = self.timeline.at(self.timeline.rows, count)
        self.timeline.rows += count
        return self._checked(number, t)

    def read(self, number: int, part: Log, name: str, t: Array) -> Array:
        """The same of a part that has them; an axis that is written and goes on is that of the parts before, too."""
        if number != self.part and len(t):
            channel = part.find(name)
            goes_on = channel.kind == "number" and not channel.derived and t[0] > self.last_read
            self.offset = self.offset if goes_on else 0.0 if t[0] > ABSOLUTE else self._since(number)
        self.last_read = float(t[-1]) if len(t) else self.last_read
        return self._checked(number, t + self.offset)

    def _since(self, number: int) -> float:
        return (self.starts[number] - self.starts[0]).total_seconds()

    def _checked(self, number: int, t: Array) -> Array:
        if not len(t):
            return t
        if number != self.part and number and t[0] <= self.last:
            one, other = self.parts[number - 1].path.name, self.parts[number]
            raise BadLog(
                f"{other.path}: it begins at {t[0]:.9g} s of the log, and {one} ends at {self.last:.9g} s: the parts "
                "overlap, so they are no parts of one recording, or a clock was wrong; give them as logs of their own"
            )
        self.part, self.last = number, float(t[-1])
        return t
