"""Read logs with C libraries in a child process, with limits of time and memory.

A damaged file can crash such a library, keep it busy for ever, or make it request more memory than there is.  Then only
the child process is lost, and the file is a `BadLog` like any other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

from davinci_forces.errors import BadLog, install
from davinci_forces.files import require_file
from davinci_forces.logs.isolated.process import REMEDY, Answer, ChildEnded, Message, answers
from davinci_forces.logs.log import Block, Log, Options, read_ahead

SECONDS = 60.0  # until a file yields a block, and of CPU time in all; more for large files, by the rates below
BYTES_PER_SECOND = 5e6  # until a block: an index may be long
BYTES_PER_CPU_SECOND = 2e5  # in all: a tenth of the rate for short messages of a bag
MEMORY = 448 << 20  # [bytes] of a child; plus `MEMORY_PER_BYTE` of the file, up to `MAX_MEMORY`
MEMORY_PER_BYTE = 4
MAX_MEMORY = 4 << 30
MAX_COMPRESSION = 2000  # size of the samples over that of the file, at most; the best compression reaches 1000
HEADER_BYTES = 1 << 16  # [bytes] added to the size, so that small files may hold a few samples


def read(path: Path, options: Options, reader: str, package: str = "") -> Log:
    """Open a log in a child process; `reader` is a module that exports `open_in_child(path) -> Log`.

    Raises BadLog if the package that it needs is not installed, or the log cannot be read within the limits.
    """
    if package and find_spec(package) is None:
        raise BadLog(f"{path}: {package}, which reads it, is not installed; run: {install(package)}")
    files = [file for file in path.iterdir() if not file.is_dir()] if path.is_dir() else [path]  # right in a bag
    for file in files:
        require_file(file)  # which libraries do not
    size = sum(file.stat().st_size for file in files)
    request = {
        "reader": reader, "path": str(path.absolute()), "names": None, "size": size,
        "seconds": SECONDS + size / BYTES_PER_SECOND, "cpu": SECONDS + size / BYTES_PER_CPU_SECOND,
        "memory": min(MEMORY + MEMORY_PER_BYTE * size, MAX_MEMORY),
    }  # fmt: skip
    [(state, _)] = _answers(path, request)
    return IsolatedLog(path, request=request, **state)


@dataclass
class IsolatedLog(Log):
    """A log that a child process reads."""

    request: Message = field(default_factory=dict)

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        yield from read_ahead(self._blocks(list(names)))

    def _blocks(self, names: list[str]) -> Iterator[Block]:
        budget = (self.request["size"] + HEADER_BYTES) * MAX_COMPRESSION
        for message, columns in _answers(self.path, self.request | {"names": names}):
            self.nulls |= message["nulls"]
            self.nans |= message["nans"]
            budget -= sum(column.nbytes for column in columns)
            if budget < 0:
                raise self.bad(f"its {self.request['size']} bytes claim more samples than they can hold: {REMEDY}")
            if columns:
                yield dict(zip(names, columns, strict=True))
            if end := message.get("end"):  # another child may read channels of another clock at the same time
                self.remember(end["warnings"], end["comments"])
                self.facts |= end["facts"]
                self.dropped += end["dropped"]
                self.cut |= end["cut"]


def _answers(path: Path, request: Message) -> Iterator[Answer]:
    problem = ""
    try:
        for message, columns in answers(request):
            if "bad" in message:
                # Read to the end, so that the child can be used again; closing the generator would end it.
                problem = message["bad"].replace(request["path"], str(path))
                continue
            yield message, columns
    except ChildEnded as why:
        raise BadLog(f"{path}: reading it {why}, so it is not read: {REMEDY}") from None
    if problem:
        raise BadLog(problem)
