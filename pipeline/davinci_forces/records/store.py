"""Records on disk: one Parquet file per record.

The columns are those of the record.  The scalars are in the file's metadata, with the unit and meaning of every field
and the sources of the file.  A file depends on nothing else, so that the same raw data give the same bytes.  It gets
its name only when it is complete.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from ctypes import CDLL
from dataclasses import fields
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from davinci_forces.errors import BadRecord, MissingRecord, PipelineError
from davinci_forces.files import digest, require_file, temporary_name
from davinci_forces.maths.arrays import BLOCK_SAMPLES
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.records.record import AnyRecord, Column, Counts, Labels, Names, Origin, Record

Unit = Callable[[str], str]

MMAP_THRESHOLD, TRIM_THRESHOLD = -3, -1  # glibc's options: sizes above which it maps memory, and returns its top
MAX_HEAP_BYTES, MAX_TOP_BYTES = 1 << 24, 1 << 26  # less of both makes short studies take twice the system's time

pa.set_memory_pool(pa.system_memory_pool())  # returns the memory of a long column as soon as it is free
with suppress(OSError, AttributeError, TypeError):  # glibc alone has it, and on Windows nothing is loaded by None
    CDLL(None).mallopt(MMAP_THRESHOLD, MAX_HEAP_BYTES)
    CDLL(None).mallopt(TRIM_THRESHOLD, MAX_TOP_BYTES)

ARROW: dict[Any, pa.DataType] = {Column: pa.float64(), Counts: pa.int64(), Labels: pa.string()}


def path(kind: type[Record], key: Names) -> Path:
    """Return the place of a record below its study's folder: `track/<log>/<joint>.parquet`."""
    first, name = key[0], ".".join(key[1:])
    folder = Path(kind.folder())
    return folder / first / f"{name}.parquet" if name else folder / f"{first}.parquet"


class Writer:
    """Writes the records of one task.  Consecutive records of one kind and key share a file.

    Use as a context: the files get their names when the block ends without an error; otherwise they are removed.
    """

    def __init__(self, folder: Path, unit: Callable[[Record], Unit], made_from: dict[str, Any]) -> None:
        self.folder, self.unit = folder, unit
        self.made_from = json.dumps(made_from, ensure_ascii=False, sort_keys=True)
        self._open: dict[Path, pq.ParquetWriter] = {}
        self._unnamed = temporary_name()
        self._described: dict[Path, dict[str, str]] = {}

    def __enter__(self) -> "Writer":
        return self

    def write(self, record: Record) -> Path:
        """Append a record's rows to its file; the scalars of the last part apply to the whole file."""
        place = path(type(record), record.key)
        if place not in self._open:
            target = self.folder / place
            target.parent.mkdir(parents=True, exist_ok=True)
            column_units = tuple(self.unit(record)(QUANTITIES[name].unit) for name in record.columns())
            described = schema(type(record), column_units)  # type: ignore[arg-type]  # a class is hashable
            self._open[place] = pq.ParquetWriter(self._unnamed(target), described, **_encoding(described))
        described = self._open[place].schema
        columns = {f.name: _column(getattr(record, f.name), f.type) for f in described}
        self._open[place].write_table(pa.table(columns, described), BLOCK_SAMPLES)
        values = {name: getattr(record, name) for name in record.scalars()}
        units = {name: self.unit(record)(QUANTITIES[name].unit) for name in record.scalars()}
        self._described[place] = {
            "record": type(record).__name__,
            "scalars": json.dumps(values, ensure_ascii=False),
            "units": json.dumps(units, ensure_ascii=False),
            "made_from": self.made_from,
        }
        return place

    def __exit__(self, failure: type[BaseException] | None, *_: object) -> None:
        try:
            if failure is None:
                for place, file in self._open.items():
                    file.add_key_value_metadata(self._described[place])
                    file.close()
                for place in self._open:
                    self._unnamed(self.folder / place).replace(self.folder / place)
        finally:
            for place, file in self._open.items():
                with suppress(OSError):  # a full disk
                    file.close()
                file.is_open = False  # otherwise the garbage collector closes it again and prints an error
                self._unnamed(self.folder / place).unlink(missing_ok=True)

    @property
    def places(self) -> list[Path]:
        """The files written, below the folder."""
        return sorted(self._open)


@cache
def schema(kind: type[Record], units: tuple[str, ...]) -> pa.Schema:
    """Return the columns of a record, each with its meaning and unit."""
    types: dict[str, Any] = {f.name: f.type for f in fields(kind)}  # type: ignore[arg-type]
    return pa.schema(
        pa.field(name, ARROW[types[name]], nullable=False, metadata={"meaning": QUANTITIES[name].meaning, "unit": unit})
        for name, unit in zip(kind.columns(), units, strict=True)
    )


def read(kind: type[AnyRecord], folder: Path, place: Path, sha256: str = "", longest: int | None = None) -> AnyRecord:
    """Read a record with its origin; `sha256`, where given, saves hashing the file.

    A record of more than `longest` rows reads a column when it is accessed, and does not keep it.

    Raises MissingRecord if the file does not exist, and BadRecord if it is not a record of this kind and version.  A
    long record raises BadRecord also at the access of a column.
    """
    whole = folder / place
    with _opened(kind, whole) as file:
        stored, described = file.metadata.metadata or {}, file.schema_arrow
        metadata = {key.decode(): stored[key].decode() for key in (b"record", b"scalars", b"units")}
        if metadata["record"] != kind.__name__:
            raise KeyError(metadata["record"])
        written = json.loads(metadata["scalars"])
        scalars = {name: tuple(value) if isinstance(value, list) else value for name, value in written.items()}
        units = json.loads(metadata["units"]) | {f.name: f.metadata[b"unit"].decode() for f in described}
        if longest is None or file.metadata.num_rows <= longest:
            table = file.read()
            record = kind(**{name: _values(table[name]) for name in kind.columns()}, **scalars)
        else:
            record = kind.lazy(scalars, file.metadata.num_rows, partial(_rows_of, kind, whole))
    object.__setattr__(record, "origin", Origin(place.as_posix(), sha256 or digest(whole), units))
    return record


@contextmanager
def _opened(kind: type[Record], whole: Path) -> Iterator[pq.ParquetFile]:
    """Open the file of a record, and raise BadRecord for anything in it that cannot be read."""
    try:
        require_file(whole)  # Arrow would wait for a pipe forever
        with pq.ParquetFile(whole) as file:
            yield file
    except FileNotFoundError:
        advice = f"run the stage that writes {kind.__name__} records first"
        raise MissingRecord(f"{whole} does not exist; {advice}") from None
    except (pa.ArrowException, PipelineError, LookupError, TypeError, ValueError, OSError, MemoryError) as error:
        raise BadRecord(f"{whole}: not a {kind.__name__} record of this version ({error}); run with --force") from error


def _rows_of(kind: type[Record], whole: Path, name: str, which: slice) -> np.ndarray[Any, Any]:
    """Read some rows of one column of the record in a file, group by group: no more is in memory than they are."""
    with _opened(kind, whole) as file:
        start, stop, _ = which.indices(file.metadata.num_rows)
        is_text = file.schema_arrow.field(name).type == pa.string()
        # Arrow aligns numbers as it does those of a whole record: the last digit of a product depends on that.
        dtype = np.dtype(object if is_text else str(file.schema_arrow.field(name).type))
        size = stop - start
        column = np.empty(size, dtype) if is_text else np.frombuffer(pa.allocate_buffer(8 * size), dtype)
        end = 0
        for group in range(file.num_row_groups):
            first, end = end, end + file.metadata.row_group(group).num_rows
            if first < stop and start < end:
                values = _values(file.read_row_group(group, [name], use_threads=False)[name])
                column[max(first - start, 0) : end - start] = values[max(start - first, 0) : stop - first]
        return column


def release() -> None:
    """Return to the system the memory that the C library retains after a task."""
    with suppress(OSError, AttributeError, TypeError):  # as above
        CDLL(None).malloc_trim(0)


def _encoding(described: pa.Schema) -> dict[str, Any]:
    """Return the encoding: floats byte by byte and compressed, smaller and faster than in dictionaries.

    LZ4 takes half the time of Zstandard and 2 % more space, as bytes of a float are either noise or nearly all equal.
    """
    floats = [f.name for f in described if pa.types.is_floating(f.type)]
    return {
        "compression": "lz4",
        "use_dictionary": [f.name for f in described if f.name not in floats],
        "column_encoding": dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
        "write_statistics": False,
        "store_schema": True,
    }


def _column(values: np.ndarray[Any, Any], kind: pa.DataType) -> pa.Array:
    """Convert a column to Arrow, without a copy of numbers.

    `pa.array` would import pandas to check for its types, which takes longer than storing a short log.
    """
    if kind != pa.string():
        return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(np.ascontiguousarray(values))])
    texts = [text.encode() for text in values]
    ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(texts), pa.py_buffer(ends), pa.py_buffer(b"".join(texts)))


def _values(column: pa.ChunkedArray) -> np.ndarray[Any, Any]:
    """Convert a column of `_column` back."""
    if column.type == pa.string():
        return np.array(column.to_pylist(), object)
    dtype = np.dtype(str(column.type))
    chunks = [np.frombuffer(c.buffers()[1] or b"", dtype)[c.offset : c.offset + len(c)] for c in column.chunks]
    return chunks[0] if len(chunks) == 1 else np.concatenate(chunks or [np.empty(0, dtype)])
