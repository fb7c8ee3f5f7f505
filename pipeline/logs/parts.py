"""A log that was recorded into several files, read as one."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from pipeline.errors import BadLog
from pipeline.logs import open_log
from pipeline.logs.log import Block, Log, Options


def open_parts(files: Sequence[Path], options: Options) -> Log:
    """Open the files of a log, in order.

    Raises
    ------
    BadLog
        If one cannot be read, or has other channels than the first.
    """
    opened = [open_log(file, options) for file in files]
    return opened[0] if len(opened) == 1 else Parts(opened)


class Parts(Log):
    """Several logs of the same channels, one after the other."""

    def __init__(self, parts: Sequence[Log]) -> None:
        first = parts[0]
        super().__init__(first.path, first.format, first.channels, first.clock, first.time, first.started, first.zone)
        self.parts = parts
        for part in parts[1:]:
            if part.channels != first.channels:
                raise BadLog(f"{part.path}: its channels are not those of {first.path}, so they are not one log")
        self.facts = {"parts": ", ".join(part.path.name for part in parts), **first.facts}

    def apart(self) -> "Parts":
        """The same, with parts that are read apart, too."""
        other = super().apart()
        assert isinstance(other, Parts)
        other.parts = [part.apart() for part in self.parts]
        return other

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the parts in order; what they noticed is put together."""
        self._start_anew(names, kinds=("number", "time"))
        self.warnings.clear()
        for part in self.parts:
            yield from part.blocks(names)
            self.warnings += part.warnings
            self.comments += part.comments
            self.dropped += part.dropped
            for counts, own in ((self.nulls, part.nulls), (self.nans, part.nans)):
                for name, count in own.items():
                    counts[name] = counts.get(name, 0) + count
