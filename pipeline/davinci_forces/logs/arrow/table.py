"""Read the columns of a Parquet or Feather file in batches, with pyarrow."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import feather, ipc, parquet

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.cells import absent, integers, numbers
from davinci_forces.logs.log import Block, Channel, Log, Options, unique
from davinci_forces.logs.timeline import UNIX_EPOCH, moment
from davinci_forces.maths.arrays import Array

BATCH_ROWS = 1 << 14  # rows of a batch
BUFFER = 1 << 18  # [bytes] of a column of Parquet that are read at a time
MAPPED = 64 << 20  # [bytes] of a batch of a Feather file, above which it is mapped instead of read into memory
UNIT_KEYS = (b"unit", b"units")
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}

Batches = Callable[[Sequence[str]], Iterator[pa.RecordBatch]]


def open_in_child(path: Path, options: Options) -> Log:
    """Open the file.

    Raises
    ------
    BadLog
        If it has no columns, or one name twice.
    """
    schema, batches = _file(path)
    if not schema.names or len(set(schema.names)) < len(schema.names):
        raise BadLog(f"{path}: its columns are {', '.join(schema.names) or 'none'}; each needs a unique name")
    names = zip(unique(schema.names), schema, strict=True)
    channels = tuple(Channel(name, _unit(column), _kind(column.type)) for name, column in names)
    log = ArrowLog(path, "arrow", channels, batches=batches)
    log.columns = dict(zip((channel.name for channel in log.channels), schema.names, strict=True))
    _describe_time(log)
    return log


def _file(path: Path) -> tuple[pa.Schema, Batches]:
    with open_file(path) as file:
        head = file.read(4)
    if head == b"PAR1":
        table = parquet.ParquetFile(path, pre_buffer=False, buffer_size=BUFFER)  # else a whole row group is held
        return table.schema_arrow, lambda names: table.iter_batches(BATCH_ROWS, columns=list(names), use_threads=False)
    if head == b"FEA1":
        rows = feather.read_table(path, use_threads=False)
        return rows.schema, lambda names: iter(rows.select(names).to_batches(BATCH_ROWS))
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
    return next((metadata[key].decode("utf-8", "replace") for key in UNIT_KEYS if metadata.get(key)), "")


def _kind(what: pa.DataType) -> str:
    if pa.types.is_timestamp(what):
        return "time"
    # A dictionary column holds labels, even if the labels are numbers.
    of = pa.types
    tests = (of.is_integer, of.is_floating, of.is_boolean, of.is_decimal, of.is_duration)
    numeric = any(test(what) for test in tests)
    return "number" if numeric else "text"


@dataclass
class ArrowLog(Log):
    """An opened table.  Time stamps become seconds from the whole second in which the log started."""

    batches: Batches = field(default=lambda names: iter(()))
    columns: dict[str, str] = field(default_factory=dict)  # by channel
    origin: int = 0  # [s] since 1970; the zero of time stamps

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says."""
        self._restart(names, kinds=("number", "time"))
        for batch in self.batches([self.columns[name] for name in names]):
            columns = {name: batch.column(self.columns[name]) for name in names}
            block = {name: _numbers(column, self.origin) for name, column in columns.items()}
            if batch.num_rows:
                yield self.count_nans(block, {name: column.null_count for name, column in columns.items()})


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
    for batch in log.batches([log.columns[log.time]]):
        stamps = pc.drop_null(batch.column(0))
        if len(stamps):
            log.origin = stamps[0].cast(pa.int64()).as_py() // PER_SECOND[stamps.type.unit]
            began = moment(UNIX_EPOCH, log.origin)
            log.started = began.replace(tzinfo=None).isoformat() if began else ""
            log.zone = "UTC" if stamps.type.tz else "local"
            return
