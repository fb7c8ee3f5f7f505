"""The interface of log formats: logs, channels and clocks.

A format is a module of this folder that exports two functions:

    recognises(path: Path, head: bytes) -> bool      from the name and the first 4096 bytes alone
    read(path: Path, options: Options) -> Log        raises BadLog

`read` looks at headers only; the samples are read by iterating over `Log.blocks`.

A channel may have its own clock: `Channel.time` names the channel of the same log with its sample times, in seconds
from `Log.started`.  Where the file has no such channel, the reader derives one (`derived`, of kind "time"), with
the correct times of every file segment and write.  Channels on one uniform clock need none: `Log.clock` describes it.
To read several clocks at once, use `Log.independent_copy`, which is shallow; `blocks` therefore keeps the state of its
own pass.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadLog
from davinci_forces.maths.units import unit_in as unit_in

Block = dict[str, NDArray[np.float64]]  # channel name -> samples; every array of a block has one length
UNIT_OF_COUNTS = "samples"  # unit of a time channel that only counts samples
UNSET_START = "1904-01-01T00:00:00"  # LabVIEW's zero, which it writes for an unknown start
SAMPLED_KINDS = ("number", "time")  # kinds of channels that are read
BLOCK_ROWS = 1 << 16  # rows of a full block
BLOCK_CELLS = 1 << 20  # of a full block of many channels


class BadContent(ValueError):
    """Content that is not as its format says, or not clear; the message omits the file, and perhaps the place."""


@dataclass(frozen=True)
class Options:
    """How to read a file, as a study states it; None is detected from the file."""

    delimiter: str | None = None
    decimal: str | None = None  # "." or ","
    header: bool | None = None  # the first row holds names
    encoding: str | None = None
    dtype: str | None = None  # of raw binary numbers: "float64", "<i2"; big-endian by default
    columns: int | tuple[str, ...] | None = None  # of a row of raw binary numbers: their count or names


@dataclass(frozen=True)
class Channel:
    """One channel of a log, with a name that is unique in the log; `unit` is as the log states it, or ""."""

    name: str
    unit: str = ""
    kind: str = "number"  # or "text", "time"; channels that are not quantities are listed, too
    derived: bool = False  # computed by the reader, not in the file ("elapsed")
    time: str = ""  # the channel of its sample times; "" for the clock of the log: `Log.time`, else `Log.clock`
    alias: str = ""  # another name that `find` accepts: a joint's name for its number, or another spelling


@dataclass(frozen=True)
class Clock:
    """A uniform clock that the format states, for logs without a time channel: t = start + i * step [s]."""

    step: float
    start: float = 0.0


@dataclass
class Log:
    """An opened log; reading its blocks resets its `warnings`, `facts`, `comments` and counts, and completes them."""

    path: Path
    format: str  # the name of the module that reads it
    channels: tuple[Channel, ...]  # in the order of the file
    clock: Clock | None = None
    time: str = ""  # the channel of the log's time axis, where the format has one
    started: str = ""  # date and time of the first sample as the file gives it, ISO 8601; "" where it does not
    zone: str = ""  # "UTC", "local" or ""
    facts: dict[str, str] = field(default_factory=dict)  # delimiter, encoding, operator ...: shown to the user
    warnings: list[str] = field(default_factory=list)  # one line each: the place in the file, and what was done
    comments: list[str] = field(default_factory=list)  # the operator's comments in the file, each with its row
    nulls: dict[str, int] = field(default_factory=dict)  # missing samples of every channel read
    nans: dict[str, int] = field(default_factory=dict)  # samples logged as NaN of every channel read
    dropped: int = 0  # unusable rows
    cut: bool = False  # the file is truncated, so channels may end in missing samples
    unread: dict[str, str] = field(default_factory=dict)  # by channel whose samples are not clear, why
    lent: dict[str, str] = field(default_factory=dict)  # by channel without a clock, the one whose clock it is given
    _at_open: tuple[int, int] | None = field(default=None, init=False, repr=False)  # warnings and comments from headers
    _indexed: tuple[tuple[Channel, ...], dict[str, Channel], set[str]] = field(
        default=((), {}, set()), init=False, repr=False, compare=False
    )  # channels, the same by name, and the clocks among them

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, all of one clock, in consecutive blocks of bounded size.

        Channels on several clocks are read one clock after the other, see `by_clock`.  Missing cells and cells that
        hold NaN are both NaN in the block; `nulls` and `nans` count them separately.  Raises BadLog with the file, line
        and column if damage makes the rest of the file unreadable.
        """
        self.nulls, self.nans = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
        self.dropped = 0
        self._at_open = self._at_open or (len(self.warnings), len(self.comments))
        del self.warnings[self._at_open[0] :], self.comments[self._at_open[1] :]
        if problem := next((self.unread[name] for name in names if name in self.unread), ""):
            raise self.bad(problem)
        for name in names:
            if (kind := self.find(name).kind) not in SAMPLED_KINDS:
                raise self.bad(f"channel {name!r} holds {kind}, not numbers; choose another")
        if len(names) > 1 and len(clocks := self.by_clock(names)) > 1:
            raise self.bad(f"{', '.join(map(repr, names))} have {len(clocks)} clocks; read them one by one")
        yield from self._read(names)

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of channels of one clock that hold numbers or times."""
        raise NotImplementedError

    def bad(self, problem: str) -> BadLog:
        """The error of a problem of this log, which names its file."""
        return BadLog(f"{self.path}: {problem}")

    def remember(self, warnings: Sequence[str], comments: Sequence[str]) -> None:
        """Add the warnings and comments of another pass over the same samples, each once."""
        self.warnings += [warning for warning in warnings if warning not in self.warnings]
        self.comments += [comment for comment in comments if comment not in self.comments]

    def find(self, name: str | int) -> Channel:
        """Find a channel by name, a unique last part of it, or its number from 0; raises BadLog with the closest."""
        if isinstance(name, int):
            written = [channel for channel in self.channels if not channel.derived]
            if not 0 <= name < len(written):
                raise self.bad(f"there is no column {name}; its {len(written)} columns are counted from 0")
            return written[name]
        by_name, _ = self._index()
        if name in by_name:
            return by_name[name]
        exact = [channel for channel in self.channels if channel.alias == name]
        last = [c for c in self.channels if c.name.endswith(f"/{name}") or c.alias.endswith(f"/{name}")]
        if len(exact or last) == 1:
            return (exact or last)[0]
        if last:
            raise self.bad(f"{len(last)} channels are called {name!r}; write {_listed(last, ' or ')}")
        names = [channel.name for channel in self.channels]
        close = get_close_matches(name, names, n=3, cutoff=0.5)
        near = [channel for channel in self.channels if channel.name in close]
        hint = f"the closest are {_listed(near)}" if near else f"it has {_listed(self.channels[:12])}"
        raise self.bad(f"there is no channel {name!r} among its {len(names)}; {hint}")

    def times_called(self, name: str | int) -> list[Channel]:
        """List the time channels of a name: one, or one in each group of channels; raises BadLog if there is none."""
        if isinstance(name, int):
            return [self.find(name)]
        last = name.rpartition("/")[2]
        alike = [c for c in self.channels if "/" in c.name and c.name.rpartition("/")[2] == last and not c.derived]
        exact = [c for c in self.channels if c.name == name]
        others = [c for c in alike if c not in exact] if not exact or "/" in name else []
        return [*exact, *others] or [self.find(name)]

    def independent_copy(self) -> Self:
        """Copy the log, to be read at the same time as this one, with separate counts and warnings."""
        twin = copy(self)
        twin.warnings, twin.comments, twin.facts = [*self.warnings], [*self.comments], {**self.facts}
        return twin

    def by_clock(self, names: Sequence[str]) -> dict[str, list[str]]:
        """Group names of channels by their clock: its time channel, or "" for the clock of the log."""
        _, clocks = self._index()
        grouped: dict[str, list[str]] = {}
        for name in names:
            channel = self.find(name)
            grouped.setdefault(channel.name if channel.name in clocks else channel.time, []).append(name)
        return grouped

    def _index(self) -> tuple[dict[str, Channel], set[str]]:
        """Index the channels by name, and the names of clocks: once, as a log may have a clock for each channel."""
        if self._indexed[0] is not self.channels:
            by_name = {channel.name: channel for channel in self.channels}
            self._indexed = self.channels, by_name, {channel.time for channel in self.channels}
        return self._indexed[1:]

    def count_nans(self, block: Block, missing: Mapping[str, int] = MappingProxyType({})) -> Block:
        """Count the NaNs of a block and return it: `missing` of each channel are missing, the others logged."""
        for name, values in block.items():
            self.nulls[name] += missing.get(name, 0)
            self.nans[name] += int(np.count_nonzero(np.isnan(values))) - missing.get(name, 0)
        return block


def _listed(channels: Sequence[Channel], joint: str = ", ") -> str:
    return joint.join(repr(channel.name) for channel in channels) or "none"


def unique(names: Sequence[str], taken: Iterable[str] = ()) -> tuple[str, ...]:
    """Make names unique: append `_1`, `_2` ... to repeated ones, and call empty ones `column_<number>`."""
    used: dict[str, None] = dict.fromkeys(taken)
    for column, name in enumerate(names):
        name = name or f"column_{column}"
        free, number = name, 0
        while free in used:
            number += 1
            free = f"{name}_{number}"
        used[free] = None
    return tuple(used)[len(used) - len(names) :]


def read_ahead(blocks: Iterator[Block]) -> Iterator[Block]:
    """Merge blocks into blocks of at least `BLOCK_ROWS` rows or `BLOCK_CELLS` cells, but for the last.

    The next block is read while the caller uses this one: parsing and compressing both release the interpreter, so
    reading and storing a log share two processors.  One block alone is not worth the start of a thread.
    """
    gathered = _gathered(blocks)
    block = next(gathered, None)
    if block and not _is_full(row_count(block), len(block)):
        yield block
    elif block:
        with ThreadPoolExecutor(max_workers=1) as reader:
            while block:
                following = reader.submit(next, gathered, None)
                yield block
                block = following.result()


def _gathered(blocks: Iterator[Block]) -> Iterator[Block]:
    waiting: list[Block] = []
    rows = 0
    for block in blocks:
        waiting.append(block)
        rows += row_count(block)
        if _is_full(rows, len(block)):
            yield concatenate(waiting)
            waiting, rows = [], 0
    if rows:
        yield concatenate(waiting)


def row_count(block: Block) -> int:
    """The number of rows of a block."""
    return len(next(iter(block.values()), ()))


def _is_full(rows: int, channels: int) -> bool:
    return rows >= BLOCK_ROWS or rows * channels >= BLOCK_CELLS


def concatenate(blocks: Sequence[Block]) -> Block:
    """Join consecutive blocks of the same channels."""
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
