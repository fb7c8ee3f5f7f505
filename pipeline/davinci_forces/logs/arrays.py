"""Logs that hold arrays by name, as MATLAB and HDF5 do: their columns as channels, read in slices."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from davinci_forces.logs.log import Block, Channel, Log, unique
from davinci_forces.maths.arrays import Array

CELLS = 1 << 20  # of a block, at most
MOST_COLUMNS = 256  # beyond which a matrix is no recording, but an image or a table of something else
MOST_FACTS = 40  # that people want to read
NUMBERS = "biuf"  # the kinds of dtypes


class Sliced(Protocol):
    """An array that need not be in memory."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Its lengths."""

    @property
    def dtype(self) -> Any:
        """Of its elements."""

    def __getitem__(self, part: Any) -> Any:
        """A part of it."""


@dataclass(frozen=True)
class Named:
    """An array of a log: samples along its longer axis, and beside each other what was sampled together."""

    name: str
    data: Sliced
    unit: str = ""
    time: str = ""  # the array of the same log that says when

    @cached_property
    def axes(self) -> tuple[int, ...]:
        """The axes that hold more than one element, that of the samples first."""
        longer = [axis for axis, length in enumerate(self.data.shape) if length != 1]
        return tuple(sorted(longer, key=lambda axis: -self.data.shape[axis]))

    @property
    def rows(self) -> int:
        """How many samples there are."""
        return self.data.shape[self.axes[0]] if self.axes else 1

    @property
    def columns(self) -> int:
        """How many quantities were sampled."""
        return self.data.shape[self.axes[1]] if len(self.axes) > 1 else 1

    @property
    def is_recording(self) -> bool:
        """Whether it holds samples: more than one, of not too many quantities."""
        return 1 <= len(self.axes) <= 2 and self.rows > 1 and self.columns <= MOST_COLUMNS

    @property
    def kind(self) -> str:
        """What a channel of it holds."""
        kind = self.data.dtype.kind
        return "number" if kind in NUMBERS else "complex" if kind == "c" else "text"

    def part(self, first: int, last: int) -> Array:
        """Samples from one to before another; shape (samples, columns)."""
        every: list[Any] = [slice(None) if axis in self.axes else 0 for axis in range(len(self.data.shape))]
        every[self.axes[0]] = slice(first, last)
        part = np.asarray(self.data[tuple(every)], np.float64)
        if part.ndim == 1:
            return part[:, None]
        return part if self.axes[0] < self.axes[1] else part.T


@dataclass
class ArrayLog(Log):
    """An opened log of arrays.  Those of unequal lengths are filled up with NaN behind their ends."""

    of: dict[str, tuple[Named, int]] = field(default_factory=dict)  # by channel: its array, and the column of it

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says."""
        self._start_anew(names, kinds=("number", "time"))
        of = {name: self.of[name] for name in names}
        arrays = {id(array): array for array, _ in of.values()}
        rows = max((array.rows for array in arrays.values()), default=0)
        step = max(1, CELLS // max(1, sum(array.columns for array in arrays.values())))
        for first in range(0, rows, step):
            last = min(first + step, rows)
            parts = {which: _filled(array, first, last) for which, array in arrays.items()}
            lacking = {name: max(0, last - max(first, array.rows)) for name, (array, _) in of.items()}
            columns = {name: parts[id(array)][:, column] for name, (array, column) in of.items()}
            yield self.tallied({name: np.ascontiguousarray(column) for name, column in columns.items()}, lacking)


def _filled(array: Named, first: int, last: int) -> Array:
    part = array.part(first, min(last, array.rows)) if first < array.rows else np.empty((0, array.columns))
    lacking = last - first - len(part)
    return np.concatenate((part, np.full((lacking, array.columns), np.nan))) if lacking else part


def take_in(log: ArrayLog, arrays: Sequence[Named]) -> None:
    """Make the columns of arrays the channels of a log; what is no recording is a fact."""
    recordings = [array for array in arrays if array.is_recording]
    for array in arrays:
        if not array.is_recording:
            log.facts[array.name] = _shown(array)
    if len(log.facts) > MOST_FACTS:
        more = len(log.facts) - MOST_FACTS
        log.facts = dict(list(log.facts.items())[:MOST_FACTS]) | {"...": f"{more} more that are no recordings"}
    clocks = {array.time for array in recordings}
    columns = [(array, column) for array in recordings for column in range(array.columns)]
    called = unique([f"{a.name}[{column}]" if a.columns > 1 else a.name for a, column in columns])
    log.of = dict(zip(called, columns, strict=True))
    log.channels = tuple(
        Channel(
            name, a.unit, "time" if a.name in clocks and a.kind == "number" else a.kind, time=a.time,
            alias=name.replace("/", ".") if "/" in name else "",
        )
        for name, (a, _) in log.of.items()
    )  # fmt: skip
    lengths = {array.name: array.rows for array in recordings if not array.time}
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{name}: {length}" for name, length in list(lengths.items())[:6])
        log.warnings.append(f"arrays have different numbers of samples ({counts}); the shorter end in nulls")


def matlab_object(name: str, kind: str = "") -> str:
    """What to say of an object of MATLAB, with the line of MATLAB that makes a struct of a timeseries."""
    said, variable = name.replace("/", "."), re.sub(r"\W+", "_", name).strip("_")
    line = (
        f"{variable} = struct('Time', {said}.Time, 'Data', squeeze({said}.Data)); save('{variable}.mat', '{variable}')"
    )
    what = f"{name} is a MATLAB object{f' ({kind})' if kind else ''}, which MATLAB alone reads"
    if kind not in ("", "timeseries"):
        return f"{what}: save its numbers as variables of their own"
    return f"{what}: of a timeseries, run this in MATLAB and read the new file: {line}"


def _shown(array: Named) -> str:
    shape = array.data.shape
    if np.prod(shape, dtype=np.float64) != 1 or array.kind == "text":
        return "left out: " + (" x ".join(map(str, shape)) or "empty")
    return str(np.asarray(array.data[(0,) * len(shape)])[()])
