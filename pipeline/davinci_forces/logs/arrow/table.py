"""Read the columns of a Parquet or Feather file in batches, with pyarrow."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import ipc, parquet

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.arrays import MAX_COLUMNS
from davinci_forces.logs.cells import absent, integers, numbers
from davinci_forces.logs.log import Block, Channel, Log, unique
from davinci_forces.logs.timeline import UNIX_EPOCH, moment
from davinci_forces.maths.arrays import Array

BATCH_ROWS = 1 << 14  # rows of a batch
MAPPED = 64 << 20  # [bytes] of a batch of a Feather file, above which it is mapped instead of read into memory
# A buffer [bytes] of each column of Parquet is read at a time; otherwise whole row groups are held.
PARQUET = {"pre_buffer": False, "buffer_size": 1 << 18, "page_checksum_verification": True}
LISTS = (pa.types.is_fixed_size_list, pa.types.is_list, pa.types.is_large_list)
EPISODES = ("timestamp", "episode_index")  # columns of LeRobot: times [s] that begin anew, and the episode's number
EPISODE_GAP = 1.0  # [s] between episodes: longer than any sampling time of a robot, so that none is joined to the next
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}

Batches = Callable[[Sequence[str]], Iterator[pa.RecordBatch]]


def open_in_child(path: Path) -> Log:
    """Open the file; raises BadLog if it has no columns, or one name twice."""
    schema, batches = _file(path)
    if not schema.names or len(set(schema.names)) < len(schema.names):
        raise BadLog(f"{path}: its columns are {', '.join(schema.names) or 'none'}; each needs a unique name")
    cells = [(column, place) for column in schema for place in _places(column, batches)]
    names = unique([column.name if place is None else f"{column.name}[{place}]" for column, place in cells])
    channels = tuple(
        Channel(name, _unit(column), _kind(column.type if place is None else column.type.value_type))
        for name, (column, place) in zip(names, cells, strict=True)
    )
    columns = dict(zip(names, ((column.name, place) for column, place in cells), strict=True))
    log = ArrowLog(path, "arrow", channels, batches=batches, columns=columns)
    _describe_time(log)
    if not log.time and all(column in schema.names and log.find(column).kind == "number" for column in EPISODES):
        log.time = EPISODES[0]
        timed = replace(log.find(log.time), unit="s", kind="time")
        log.channels = tuple(timed if channel.name == timed.name else channel for channel in channels)
    return log


def _places(column: pa.Field, batches: Batches) -> Sequence[int | None]:
    """List the places in lists of one length, which become channels; None stands for a column without such lists."""
    if not any(test(column.type) for test in LISTS) or _kind(column.type.value_type) != "number":
        return [None]
    if pa.types.is_fixed_size_list(column.type):
        size = column.type.list_size
    else:
        lists = (pc.drop_null(batch.column(0)) for batch in batches([column.name]))
        size = next((len(some[0]) for some in lists if len(some)), 0)
    return range(size) if 0 < size <= MAX_COLUMNS else [None]


def _file(path: Path) -> tuple[pa.Schema, Batches]:
    with open_file(path) as file:
        head = file.read(4)
    if head == b"PAR1":
        table = parquet.ParquetFile(path, **PARQUET)
        return table.schema_arrow, lambda names: table.iter_batches(BATCH_ROWS, columns=list(names), use_threads=False)
    return ipc.open_file(str(path)).schema, lambda names: _records(path, names)


def _records(path: Path, names: Sequence[str]) -> Iterator[pa.RecordBatch]:
    """Read the batches of these columns alone; only large batches are mapped, because mapped bytes count as memory."""
    whole = ipc.open_file(str(path))
    mapped = path.stat().st_size > MAPPED * whole.num_record_batches
    columns = ipc.IpcReadOptions(included_fields=[whole.schema.names.index(name) for name in names], use_threads=False)
    file = ipc.open_file(pa.memory_map(str(path)) if mapped else pa.OSFile(str(path)), options=columns)
    for i in range(file.num_record_batches):
        batch = file.get_batch(i).select(names)
        batch.validate(full=True)
        for first in range(0, batch.num_rows, BATCH_ROWS):
            yield batch.slice(first, BATCH_ROWS)


def _unit(column: pa.Field) -> str:
    if pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type):
        return "s"
    metadata = column.metadata or {}
    return next((metadata[key].decode("utf-8", "replace") for key in (b"unit", b"units") if metadata.get(key)), "")


def _kind(what: pa.DataType) -> str:
    if pa.types.is_timestamp(what):
        return "time"
    of = pa.types  # a dictionary column holds labels, even if the labels are numbers
    tests = (of.is_integer, of.is_floating, of.is_boolean, of.is_decimal, of.is_duration)
    return "number" if any(test(what) for test in tests) else "text"


@dataclass
class ArrowLog(Log):
    """An opened table.  Time stamps become seconds from the whole second in which the log started."""

    batches: Batches = field(default=lambda names: iter(()))
    columns: dict[str, tuple[str, int | None]] = field(default_factory=dict)  # by channel; with the place in lists
    origin: int = 0  # [s] since 1970; the zero of time stamps

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        episodes = _Episodes() if self.time == EPISODES[0] and self.time in names else None
        needed = {self.columns[name][0] for name in (*names, *(EPISODES if episodes else ()))}
        sizes = Counter(column for column, place in self.columns.values() if place is not None)
        for batch in self.batches(sorted(needed)):
            arrays = {column: batch.column(column) for column in needed}
            values = {column: self._values(column, array, sizes[column]) for column, array in arrays.items()}
            if episodes:
                values[EPISODES[0]] = episodes.times(*(values[column] for column in EPISODES))
            cells = {name: self.columns[name] for name in names}
            block = {n: values[c] if p is None else values[c][:, p].copy() for n, (c, p) in cells.items()}
            if batch.num_rows:
                yield self.count_nans(block, {name: arrays[column].null_count for name, (column, _) in cells.items()})

    def _values(self, column: str, array: pa.Array, size: int) -> Array:
        """Convert a column to numbers (N,), or its lists of one length to numbers (N, size)."""
        if not size:
            return _numbers(array, self.origin)
        lengths = pc.list_value_length(array).fill_null(size)
        if len(array) and pc.min_max(lengths).as_py() != {"min": size, "max": size}:
            raise self.bad(f"the lists of {column!r} have different lengths; save a column for each place")
        present = _numbers(array.flatten(), self.origin).reshape(-1, size)
        if not array.null_count:
            return present
        values = np.full((len(array), size), np.nan)
        values[~absent(pa.chunked_array([array]))] = present
        return values


@dataclass
class _Episodes:
    """Episodes of a LeRobot data set, whose times begin anew: each is placed `EPISODE_GAP` after the one before."""

    shift: float = 0.0  # [s] added to the times of the episode
    last: float = -np.inf  # [s] the last time on the axis
    number: float = np.nan

    def times(self, t: Array, numbers: Array) -> Array:
        """Shift the next times (N,) [s] of the episodes with these numbers (N,)."""
        parts = []
        for part in np.split(np.column_stack([t, numbers]), 1 + np.flatnonzero(np.diff(numbers))):
            if len(part) and part[0, 1] != self.number and part[0, 0] + self.shift <= self.last:
                self.shift = self.last + EPISODE_GAP - part[0, 0]
            parts.append(part[:, 0] + self.shift)
            self.last, self.number = (parts[-1][-1], part[-1, 1]) if len(part) else (self.last, self.number)
        return np.concatenate(parts)


def _numbers(column: pa.Array, origin: int) -> Array:
    """Convert a column to numbers, NaN where it has no value."""
    what = column.type
    if pa.types.is_timestamp(what) or pa.types.is_duration(what):
        per_second = PER_SECOND[what.unit]
        since = origin * per_second if pa.types.is_timestamp(what) else 0
        whole = pa.chunked_array([column.cast(pa.int64())])
        return np.where(absent(whole), np.nan, (integers(whole) - since) / per_second)
    return numbers(pa.chunked_array([column.cast(pa.float64(), safe=False)]))


def _describe_time(log: ArrowLog) -> None:
    """Make the first column of time stamps the clock, and its first whole second the start of the log."""
    log.time = next((channel.name for channel in log.channels if channel.kind == "time"), "")
    if not log.time:
        return
    for batch in log.batches([log.columns[log.time][0]]):
        stamps = pc.drop_null(batch.column(0))
        if len(stamps):
            log.origin = stamps[0].cast(pa.int64()).as_py() // PER_SECOND[stamps.type.unit]
            began = moment(UNIX_EPOCH, log.origin)
            log.started = began.replace(tzinfo=None).isoformat() if began else ""
            log.zone = "UTC" if stamps.type.tz else "local"
            return
