"""A log whose signals were recorded into files of their own, read side by side."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from davinci_forces.logs import open_log
from davinci_forces.logs.log import COUNTED, Block, Channel, Log, Options
from davinci_forces.logs.names import unique
from davinci_forces.logs.parts import ABSOLUTE, SAMPLED, require_different, starts_of
from davinci_forces.maths.arrays import Array


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
