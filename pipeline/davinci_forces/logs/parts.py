"""Read a log that was recorded in several files, one after the other, each placed by its start."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from filecmp import cmp
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from davinci_forces.logs.log import SAMPLED_KINDS, UNSET_START, Block, Channel, Log, Options, row_count, unique
from davinci_forces.logs.timeline import Timeline
from davinci_forces.maths.arrays import Array

ABSOLUTE = 1e9  # [s] a larger time counts from a fixed year, not from the start of its part


def open_parts(files: Sequence[Path], options: Options) -> Log:
    """Open the files of a log; raises BadLog if one is unreadable, a copy, out of order, or has other channels."""
    require_different(files)
    opened = [open_log(file, options) for file in files]
    return opened[0] if len(opened) == 1 else Parts(opened)


def require_different(files: Sequence[Path]) -> None:
    """Refuse files that are given twice or have equal content."""
    sizes: dict[int, list[Path]] = {}
    for file in filter(Path.is_file, files):
        same_size = sizes.setdefault(file.stat().st_size, [])
        for earlier in same_size:
            if file.samefile(earlier) or cmp(file, earlier, shallow=False):
                raise BadLog(f"{file}: it is a copy of {earlier.name}, byte by byte; list each part of a log once")
        same_size.append(file)


class Parts(Log):
    """Several logs of the same channels, one after the other.

    Each part counts its times from its own start.  A time axis in the files that continues from part to part is left
    as it is.  If parts do not state when they started, the count of samples continues.
    """

    def __init__(self, parts: Sequence[Log]) -> None:
        first = parts[0]
        super().__init__(first.path, first.format, first.channels, first.clock, first.time, first.started, first.zone)
        self.parts = list(parts)
        for part in parts[1:]:
            if _written(part) != _written(first):
                raise part.bad(f"its channels differ from those of {first.path}, so they are not one log")
        self.facts = {"parts": ", ".join(part.path.name for part in parts), **first.facts}
        self.cut, self.lent = parts[-1].cut, first.lent
        self.starts = starts_of(parts)
        remark = "not all parts say when they started; each is assumed to begin directly after the one before"
        self.remarks = [remark] if first.clock and not self.starts else []
        self.times: dict[str, frozenset[str]] = {}  # by time channel, the channels on that clock
        if self.starts or (first.clock and any(part.clock != first.clock for part in parts)):
            self._place()

    def _place(self) -> None:
        """Give every clock of the parts a time channel, and check the starts."""
        _require_order(self.parts, self.starts)
        shared = _partition(self.parts[0])
        if any(_partition(part).keys() != shared.keys() for part in self.parts):
            why = "the parts of this log do not have the same channels on one clock"
            raise self.bad(f"{why}; give each as a separate log")
        written = [channel for channel in self.channels if not (channel.derived and channel.kind == "time")]
        names = [channel.name for channel in written]
        for names_of_clock in shared:
            clocks = [_partition(part)[names_of_clock] for part in self.parts]
            if not all(time or part.clock for time, part in zip(clocks, self.parts, strict=True)):
                continue  # their sample times are unknown
            written_time = clocks[0] if len(set(clocks)) == 1 and clocks[0] in names else ""
            new_time = clocks[0] if clocks[0] not in names else ""
            [time] = [written_time] if written_time else unique([new_time or "time"], [*names, *self.times])
            self.times[time] = names_of_clock
        clocks_of_first = ((time, self.parts[0].by_clock(sorted(names)[:1])) for time, names in self.times.items())
        main = next((time for time, clock in clocks_of_first if "" in clock), "")
        self.clock, self.time = None, main
        time_of = {name: time for time, names_of_clock in self.times.items() for name in names_of_clock}
        timed = (replace(c, time="" if time_of.get(c.name, main) == main else time_of[c.name]) for c in written)
        new = (Channel(t, "s", "time", True, "" if t == main else t) for t in self.times if t not in names)
        self.channels = (*timed, *new)

    def independent_copy(self) -> Self:
        """Copy the log and its parts, to be read at the same time as this one."""
        twin = super().independent_copy()
        twin.parts = [part.independent_copy() for part in self.parts]
        return twin

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the parts in order, with their warnings, comments and counts; raises BadLog if two overlap."""
        self.warnings[:] = self.remarks
        time = next((time for time in names if time in self.times), "")
        axis = _Axis(self.parts, self.starts)
        for number, part in enumerate(self.parts):
            if not time:
                yield from part.blocks(names)
            else:
                yield from self._placed(axis, number, part, names, time)
            self.warnings += part.warnings
            self.comments += part.comments
            self.dropped += part.dropped
            for counts, part_counts in ((self.nulls, part.nulls), (self.nans, part.nans)):
                for name, count in part_counts.items():
                    counts[name] = counts.get(name, 0) + count

    def _placed(self, axis: "_Axis", number: int, part: Log, names: Sequence[str], time: str) -> Iterator[Block]:
        clock_channels = self.times[time]
        part_time = _partition(part)[clock_channels]
        others = [name for name in names if name != time]
        counted = [] if part_time or others else sorted(clock_channels)[:1]  # gives the number of samples
        for block in part.blocks([*others, *([part_time] if part_time else []), *counted]):
            count = row_count(block)
            t = axis.read(number, part, part_time, block[part_time]) if part_time else axis.count(number, part, count)
            yield {name: t if name == time else block[name] for name in names}


def _written(log: Log) -> list[tuple[str, str, str]]:
    channels = (c for c in log.channels if not (c.derived and c.kind == "time"))
    return [(c.name, c.unit, c.kind) for c in channels if c.name != "elapsed"]


def _partition(log: Log) -> dict[frozenset[str], str]:
    """Map the channels of each clock of a log to their time channel; "" for a clock that counts samples."""
    sampled = [c.name for c in log.channels if c.kind in SAMPLED_KINDS and not c.derived]
    groups = log.by_clock(sampled)
    return {frozenset(names): time or log.time for time, names in groups.items()}


def starts_of(parts: Sequence[Log]) -> list[float]:
    """List the starts of the parts [s], from that of the first; empty unless all state one in the same time zone."""
    texts = [part.started for part in parts]
    if not all(texts) or len({part.zone for part in parts}) > 1:
        return []
    starts = [datetime.fromisoformat(text) for text in texts]
    clocked = all(part.time or part.clock or any(channel.time for channel in part.channels) for part in parts)
    is_set = not any(text.startswith(UNSET_START) for text in texts)
    return [(start - starts[0]).total_seconds() for start in starts] if clocked and is_set else []


def _require_order(parts: Sequence[Log], starts: Sequence[float]) -> None:
    started = zip(parts, starts, strict=False)  # empty where starts are unknown
    for (part, start), (following, later) in pairwise(started):
        if later < start:
            right = sorted(range(len(parts)), key=lambda i: starts[i])
            names = ", ".join(f'"{parts[i].path.name}"' for i in right)
            why = f"earlier than {part.path.name}, which started at {part.started}"
            remedy = f"list the parts in this order: files = [{names}]"
            raise following.bad(f"it started at {following.started}, {why}; {remedy}")


@dataclass
class _Axis:
    """The times of one clock over consecutive parts."""

    parts: Sequence[Log]
    starts: Sequence[float]  # [s] of the parts, from that of the first
    timeline: Timeline = field(default_factory=Timeline)  # of parts that count samples
    part: int = -1
    offset: float = 0.0  # [s] added to the times of the part
    last: float = -np.inf  # [s] last time on the axis
    last_read: float = -np.inf  # [s] the same time as the part states it

    def count(self, number: int, part: Log, count: int) -> Array:
        """Compute the times of the next samples of a part that counts them."""
        assert part.clock is not None
        new = number != self.part and bool(self.starts)  # without starts, a part follows the one before directly
        self.timeline.add(0, self.starts[number] + part.clock.start if new else None, part.clock.step)
        t = self.timeline.times(self.timeline.rows, count)
        self.timeline.rows += count
        return self._checked(number, t)

    def read(self, number: int, part: Log, name: str, t: Array) -> Array:
        """Shift the times that a part states; a written axis that continues the parts before stays as it is."""
        if number != self.part and len(t):
            channel = part.find(name)
            goes_on = channel.kind == "number" and not channel.derived and t[0] > self.last_read
            since = 0.0 if t[0] > ABSOLUTE or not self.starts else self.starts[number]
            self.offset = self.offset if goes_on else since
        self.last_read = float(t[-1]) if len(t) else self.last_read
        return self._checked(number, t + self.offset)

    def _checked(self, number: int, t: Array) -> Array:
        if not len(t):
            return t
        if number != self.part and number and t[0] <= self.last:
            before, part = self.parts[number - 1].path.name, self.parts[number]
            overlap = f"it begins at {t[0]:.9g} s of the log, but {before} ends at {self.last:.9g} s; the parts overlap"
            why = "so they belong to different recordings, or a clock was wrong: give them as separate logs"
            raise part.bad(f"{overlap}, {why}")
        self.part, self.last = number, float(t[-1])
        return t
