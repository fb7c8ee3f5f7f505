"""Parse numbers from rows of delimited cells, one block at a time, with Arrow."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array, Booleans, Integers

Number = TypeVar("Number", np.float64, np.int64, np.uint8)

NUMBER = re.compile(rb"[+-]?((\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|nan|inf|infinity)", re.IGNORECASE)
UNREADABLE = pa.ArrowInvalid
MISSING = frozenset(("NA", "N/A", "n/a", "#N/A", "<NA>", "null", "NULL", "None", "-", "--"))  # words for no sample
PARSE_BYTES = 1 << 20  # [bytes] that one thread of Arrow parses at a time


def numbers(column: pa.ChunkedArray) -> Array:
    """Convert a column of doubles (N,), NaN where it has no value."""
    values = _values(column, np.float64)
    if column.null_count:
        values[absent(column)] = np.nan
    return values


def integers(column: pa.ChunkedArray) -> Integers:
    """Convert a column of 64-bit integers (N,), of any value where it has none."""
    return _values(column, np.int64)


def absent(column: pa.ChunkedArray) -> Booleans:
    """Mask (N,) of the rows in which a column has no value."""
    return _values(column.is_null().cast(pa.uint8()), np.uint8).view(bool)


def _values(column: pa.ChunkedArray, dtype: type[Number]) -> NDArray[Number]:
    chunks = ((chunk, np.frombuffer(chunk.buffers()[1] or b"", dtype)) for chunk in column.chunks)
    parts = [values[chunk.offset : chunk.offset + len(chunk)] for chunk, values in chunks]
    return np.concatenate(parts or [np.empty(0, dtype)])


class NotANumber(ValueError):
    """The row and the column, counted from 0, of a cell that is not a number, and the cell."""


@dataclass(frozen=True)
class Cells:
    """Columns of numbers, NaN where a cell is empty; the counts of empty cells; and the cells of a column of text."""

    rows: int
    columns: dict[int, NDArray[np.float64]]
    nulls: dict[int, int]
    texts: list[bytes | None]
    empty: dict[int, Booleans] = field(default_factory=dict)  # masks of the columns with empty cells


def marks(block: bytes, delimiter: bytes) -> bytes:
    """Find the decimal marks in a block: `.`, `,`, both or none."""
    return bytes(mark for mark in b".," if mark != delimiter[0] and mark in block)


def parse(
    block: bytes, width: int, delimiter: bytes, decimal: bytes, wanted: Sequence[int], text: int = -1,
    quoted: bool = False, times: Mapping[int, Callable[[pa.ChunkedArray], Array]] = MappingProxyType({}),
    missing: Iterable[str] = (),
) -> Cells:  # fmt: skip
    """Convert the `wanted` columns of rows of `width` cells to numbers; column `text` is not converted.

    `times` converts those wanted columns that are not written as numbers.  Empty cells and the words `missing` are NaN.
    Raises UNREADABLE if a row has another width, or a wanted cell is not a number.
    """
    types = {f"{i}": pa.float64() for i in wanted} | ({f"{text}": pa.binary()} if text >= 0 else {})
    types |= {f"{i}": pa.string() for i in wanted if i in times}
    table = csv.read_csv(
        _arrow_memory(block),
        read_options=csv.ReadOptions(column_names=[f"{i}" for i in range(width)], block_size=PARSE_BYTES),
        parse_options=csv.ParseOptions(delimiter=delimiter.decode(), quote_char='"' if quoted else False),
        convert_options=csv.ConvertOptions(
            column_types=types, include_columns=list(types), null_values=["", " ", *missing],
            strings_can_be_null=bool(times), decimal_point=decimal.decode(), check_utf8=False,
        ),
    )  # fmt: skip
    columns = {i: table.column(f"{i}") for i in wanted}
    return Cells(
        rows=table.num_rows,
        columns={i: times[i](column) if i in times else numbers(column) for i, column in columns.items()},
        nulls={i: column.null_count for i, column in columns.items()},
        texts=table.column(f"{text}").to_pylist() if text >= 0 else [],
        empty={i: absent(column) for i, column in columns.items() if column.null_count},
    )


def _arrow_memory(block: bytes) -> pa.Buffer:
    """Copy bytes to memory of Arrow.

    Threads of Arrow may release it after `read_csv` has returned. Memory of Python they release through the
    interpreter, and if that is ending by then, the process aborts.
    """
    buffer = pa.allocate_buffer(len(block))
    np.frombuffer(buffer, np.uint8)[:] = np.frombuffer(block, np.uint8)
    return buffer


def parse_either(block: bytes, width: int, delimiter: bytes, wanted: Sequence[int], text: int = -1) -> Cells:
    """Parse with the decimal mark that the cells have, or with both; a cell with two marks is not a number."""
    decimals = marks(block, delimiter)
    if len(decimals) == 2 and text < 0:
        block, decimals = block.replace(b",", b"."), b"."
    return parse(block, width, delimiter, decimals[:1] or b".", wanted, text)


def parse_carefully(block: bytes, width: int, delimiter: bytes, wanted: Sequence[int]) -> Cells:
    """Parse like `parse_either`, allow blanks around numbers; raises NotANumber at a wanted cell that is none."""
    try:
        return parse_either(block, width, delimiter, wanted)
    except UNREADABLE:
        rows = [[cell.strip() for cell in row.split(delimiter)] for row in block.split(b"\n")[:-1]]
    for i, row in enumerate(rows):
        for column in wanted:
            if row[column] and not NUMBER.fullmatch(row[column]):
                raise NotANumber(i, column, row[column])
    return parse_either(b"".join(delimiter.join(row) + b"\n" for row in rows), width, delimiter, wanted)
