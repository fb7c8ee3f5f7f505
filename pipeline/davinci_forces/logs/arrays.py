"""Logs of named arrays, as in MATLAB and HDF5 files: their columns become channels, read in slices."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from davinci_forces.logs.log import BLOCK_CELLS, Block, Channel, Log, unique
from davinci_forces.maths.arrays import Array

MAX_COLUMNS = 256  # columns of a recording; a wider matrix is an image or another table
MAX_DEPTH = 20  # nesting of arrays within arrays that are read
MAX_FACTS = 40  # facts shown to the user
NUMBER_KINDS = "biuf"  # kinds of numpy dtypes


@dataclass(frozen=True)
class NamedArray:
    """An array of a log: samples along its longest axis, quantities sampled together along the other."""

    name: str
    data: Any  # an array, or what stays on disk and is read by slices, with a shape and a dtype
    unit: str = ""
    time: str = ""  # the array of the same log with the sample times

    @cached_property
    def axes(self) -> tuple[int, ...]:
        """The axes with more than one element, that of the samples first."""
        longer = [axis for axis, length in enumerate(self.data.shape) if length != 1]
        return tuple(sorted(longer, key=lambda axis: -self.data.shape[axis]))

    @property
    def rows(self) -> int:
        """Number of samples."""
        return int(self.data.shape[self.axes[0]]) if self.axes else 1

    @property
    def columns(self) -> int:
        """Number of quantities."""
        return int(self.data.shape[self.axes[1]]) if len(self.axes) > 1 else 1

    @property
    def is_recording(self) -> bool:
        """Whether it holds a recording: more than one sample, of at most `MAX_COLUMNS` quantities."""
        return 1 <= len(self.axes) <= 2 and self.rows > 1 and self.columns <= MAX_COLUMNS

    @property
    def kind(self) -> str:
        """Kind of its channels: number, complex or text."""
        kind = self.data.dtype.kind
        return "number" if kind in NUMBER_KINDS else "complex" if kind == "c" else "text"

    def part(self, first: int, last: int) -> Array:
        """Read the samples from `first` to before `last`, NaN after its end; shape (last - first, columns)."""
        part = np.empty((0, self.columns))
        if first < self.rows:
            index: list[Any] = [slice(None) if axis in self.axes else 0 for axis in range(len(self.data.shape))]
            index[self.axes[0]] = slice(first, min(last, self.rows))
            part = np.asarray(self.data[tuple(index)], np.float64)
            part = part[:, None] if part.ndim == 1 else part if self.axes[0] < self.axes[1] else part.T
        lacking = last - first - len(part)
        return np.concatenate((part, np.full((lacking, self.columns), np.nan))) if lacking else part


@dataclass
class ArrayLog(Log):
    """An opened log of arrays.  Shorter arrays end in NaN."""

    of: dict[str, tuple[NamedArray, int]] = field(default_factory=dict)  # by channel: its array and column

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        of = {name: self.of[name] for name in names}
        arrays = {id(array): array for array, _ in of.values()}
        rows = max((array.rows for array in arrays.values()), default=0)
        step = max(1, BLOCK_CELLS // max(1, sum(array.columns for array in arrays.values())))
        for first in range(0, rows, step):
            last = min(first + step, rows)
            parts = {which: array.part(first, last) for which, array in arrays.items()}
            lacking = {name: max(0, last - max(first, array.rows)) for name, (array, _) in of.items()}
            columns = {name: parts[id(array)][:, column] for name, (array, column) in of.items()}
            yield self.count_nans({name: np.ascontiguousarray(column) for name, column in columns.items()}, lacking)


def take_in(log: ArrayLog, arrays: Sequence[NamedArray]) -> None:
    """Make the columns of recordings the channels of a log, and list all other arrays as facts."""
    recordings = [array for array in arrays if array.is_recording]
    log.facts |= {array.name: _shown(array) for array in arrays if not array.is_recording}
    if len(log.facts) > MAX_FACTS:
        more = len(log.facts) - MAX_FACTS
        log.facts = dict(list(log.facts.items())[:MAX_FACTS]) | {"...": f"{more} more that are not recordings"}
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
        log.warnings.append(f"arrays have different numbers of samples ({counts}); the shorter ones end in nulls")


def matlab_object(name: str, kind: str = "") -> str:
    """Describe a MATLAB object that cannot be read, with the MATLAB code that saves a timeseries as a struct."""
    path, variable = name.replace("/", "."), re.sub(r"\W+", "_", name).strip("_")
    struct = f"struct('Time', {path}.Time, 'Data', squeeze({path}.Data))"
    line = f"{variable} = {struct}; save('{variable}.mat', '{variable}')"
    what = f"{name} is a MATLAB object{f' ({kind})' if kind else ''}, which only MATLAB reads"
    if kind not in ("", "timeseries"):
        return f"{what}: save its numbers as separate variables"
    return f"{what}: if it is a timeseries, run this in MATLAB and read the new file: {line}"


def _shown(array: NamedArray) -> str:
    shape = array.data.shape
    if np.prod(shape, dtype=np.float64) != 1 or array.kind == "text":
        return "left out: " + (" x ".join(map(str, shape)) or "empty")
    return str(np.asarray(array.data[(0,) * len(shape)])[()])
