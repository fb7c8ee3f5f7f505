"""Logs that are read by libraries in C, in a process of their own with limits of time and memory.

A damaged file can take such a library down, keep it busy for ever, or have it ask for more memory than there is.  It
then costs a child process, and is a `BadLog` like any other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from davinci_forces.errors import BadLog
from davinci_forces.files import require_file
from davinci_forces.logs.isolated.process import Ended, Message, child
from davinci_forces.logs.log import Block, Channel, Clock, Log, Options, ahead
from davinci_forces.maths.arrays import Array

SECONDS = 60.0  # that a file may take without a block, or of computing in all; and more for every so many bytes of it
BYTES_PER_SECOND = 5e6  # without a block: an index may be long
BYTES_PER_CPU_SECOND = 2e5  # in all: a tenth of what short messages of a bag take
MEMORY = 448 << 20  # [bytes] that a child may have, and so many times the size of the file, but no more than most
TIMES_ITS_SIZE = 4
MOST_MEMORY = 4 << 30
REMEDY = "it is damaged; record it again, or take it out of study.toml"
MOST_PACKED = 2000  # times its size that the samples of a file may be; what packs best packs to a thousandth
BESIDE = 1 << 16  # [bytes] so that small files of headers may hold a little


def require(path: Path, package: str, extra: str) -> None:
    """Say how to install what a format is read by.

    Raises
    ------
    BadLog
        If it is not installed.
    """
    if find_spec(package) is None:
        raise BadLog(f"{path}: {package} reads it and is not installed; run: pip install davinci-forces[{extra}]")


def start(path: Path, options: Options, reader: str) -> Log:
    """Open a log in a child; `reader` is a module that exports `opened(path, options) -> Log`.

    Raises
    ------
    BadLog
        If it cannot be read within the limits.
    """
    request = _request(path, options, reader)
    for message, _ in _answers(path, request):
        said = message["log"]
    channels = tuple(Channel(**channel) for channel in said.pop("channels"))
    clock = Clock(**clock) if (clock := said.pop("clock")) else None
    return IsolatedLog(path, channels=channels, clock=clock, request=request, **said)


@dataclass
class IsolatedLog(Log):
    """A log that a child reads."""

    request: Message = field(default_factory=dict)

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says."""
        self._start_anew(names, kinds=("number", "time"))
        yield from ahead(self._blocks(list(names)))

    def _blocks(self, names: list[str]) -> Iterator[Block]:
        left = (self.request["size"] + BESIDE) * MOST_PACKED
        for message, columns in _answers(self.path, self.request | {"names": names}):
            self.nulls |= message["nulls"]
            self.nans |= message["nans"]
            left -= sum(column.nbytes for column in columns)
            if left < 0:
                raise BadLog(
                    f"{self.path}: its {self.request['size']} bytes claim more samples than they can hold: {REMEDY}"
                )
            if columns:
                yield dict(zip(names, columns, strict=True))
            if end := message.get("end"):
                self._take(end)

    def _take(self, end: Message) -> None:
        """What the child noticed; channels of another clock may be read at the same time, by another child."""
        self.warnings += [warning for warning in end["warnings"] if warning not in self.warnings]
        self.comments += [comment for comment in end["comments"] if comment not in self.comments]
        self.facts |= end["facts"]
        self.dropped += end["dropped"]
        self.cut |= end["cut"]


def _request(path: Path, options: Options, reader: str) -> Message:
    size = _size(path)
    return {
        "reader": reader,
        "path": str(path.absolute()),
        "options": asdict(options),
        "names": None,
        "size": size,
        "seconds": SECONDS + size / BYTES_PER_SECOND,
        "cpu": SECONDS + size / BYTES_PER_CPU_SECOND,
        "memory": min(MEMORY + TIMES_ITS_SIZE * size, MOST_MEMORY),
    }


def _size(path: Path) -> int:
    """The bytes of a log, of a folder those of the files right in it; each is one, as libraries do not ask."""
    files = [file for file in path.iterdir() if not file.is_dir()] if path.is_dir() else [path]
    for file in files:
        require_file(file)
    return sum(file.stat().st_size for file in files)


def _answers(path: Path, request: Message) -> Iterator[tuple[dict[str, Any], list[Array]]]:
    problem = ""
    try:
        with child() as reading:
            for message, columns in reading.answers(request):
                if "bad" in message:
                    # Read to its end, so that the child is kept; a generator that is closed would end it.
                    problem = _problem(path, request, message)
                    continue
                yield message, columns
    except Ended as why:
        raise BadLog(f"{path}: reading it {why}, so it is not read: {REMEDY}") from None
    if problem:
        raise BadLog(problem)


def _problem(path: Path, request: Message, message: Message) -> str:
    if message.get("memory"):
        most = request["memory"] >> 20
        return (
            f"{path}: reading it takes more than {most} MB of memory; it is damaged, or holds much in one piece: save "
            "it in a format that is read in pieces, as MATLAB's -v7.3"
        )
    said = str(message["bad"]).replace(request["path"], str(path))
    return f"{path}: it cannot be read ({said}): {REMEDY}" if message.get("fault") else said
