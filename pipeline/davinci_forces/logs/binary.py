"""Raw binary numbers, as LabVIEW's Write to Binary File writes them; the study describes their layout."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import BLOCK_CELLS, Block, Channel, Log, Options, read_ahead, unique, unit_in

SUFFIXES = (".bin", ".dat")
# LabVIEW counts bits and numpy's short names count bytes; i8 and u8 are ambiguous and therefore refused.
TYPES = {"dbl": "f8", "sgl": "f4", "double": "f8", "single": "f4", "float64": "f8", "float32": "f4", "f4": "f4",
         "f8": "f8", "int8": "i1", "uint8": "u1"}  # fmt: skip
TYPES |= {name: f"{sign}{bits // 8}" for sign, word in (("i", "int"), ("u", "uint")) for bits in (16, 32, 64)
          for name in (f"{word}{bits}", f"{sign}{bits}")}  # fmt: skip
TYPES |= {code: code for code in ("i2", "i4", "u2", "u4")}
BINARY_EXAMPLE = 'dtype = "float64" and columns = ["time", "q", "i"], or their number'


def recognises(path: Path, head: bytes) -> bool:
    """Whether the name has a suffix of `SUFFIXES` and the content is not text."""
    return path.suffix.lower() in SUFFIXES and bool(re.search(rb"[\x00-\x08\x0e-\x1a]", head))


def dtype_of(text: str) -> np.dtype[np.generic] | None:
    """Parse a number type, as `float64`, `DBL` or `f8`: big-endian without a leading `<`; None for an unknown name."""
    order, word = (text[0], text[1:]) if text[:1] in ("<", ">") else (">", text)
    code = TYPES.get(word.lower())
    return np.dtype(order + code) if code else None


def read(path: Path, options: Options) -> Log:
    """Open the file; raises BadLog if the study does not state its layout, or the file cannot have it."""
    dtype = dtype_of(options.dtype or "")
    if dtype is None or not options.columns:
        remedy = f"describe it in [[log]] of study.toml: {BINARY_EXAMPLE}"
        order = '(big-endian, as LabVIEW writes; "<float64" is little-endian)'
        raise BadLog(f"{path}: raw binary files do not say what they hold; {remedy} {order}")
    count = options.columns if isinstance(options.columns, int) else len(options.columns)
    names = [f"column_{i}" for i in range(count)] if isinstance(options.columns, int) else options.columns
    pieces, layout, lost = _pieces(path, dtype, count)
    channels = tuple(Channel(name, unit_in(name)) for name in unique(names))
    facts = {"type": f"{dtype.name}, {'little' if dtype.str[0] == '<' else 'big'}-endian", "layout": layout}
    warnings = [f"the file ends within a row: its last {lost} bytes are not read"] if lost else []
    return BinaryLog(path, "binary", channels, facts=facts, warnings=warnings, cut=lost > 0, dtype=dtype, pieces=pieces)


@dataclass
class BinaryLog(Log):
    """An opened file of raw numbers, row after row."""

    dtype: np.dtype[np.generic] = field(default_factory=lambda: np.dtype(">f8"))
    pieces: list[tuple[int, int]] = field(default_factory=list)  # position and rows of each

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        yield from read_ahead(self._blocks(names))

    def _blocks(self, names: Sequence[str]) -> Iterator[Block]:
        number, columns = {channel.name: i for i, channel in enumerate(self.channels)}, len(self.channels)
        most = max(1, BLOCK_CELLS // columns)
        with open_file(self.path) as file:
            for position, rows in self.pieces:
                file.seek(position)
                for first in range(0, rows, most):
                    content = file.read(min(most, rows - first) * columns * self.dtype.itemsize)
                    cells = np.frombuffer(content, self.dtype).reshape(-1, columns)
                    yield self.count_nans({name: cells[:, number[name]].astype(np.float64) for name in names})


Pieces = list[tuple[int, int]]


def _pieces(path: Path, dtype: np.dtype[np.generic], columns: int) -> tuple[Pieces, str, int]:
    """Find the position and count of rows, a description of the layout, and the bytes of an incomplete last row.

    LabVIEW puts the sizes of an array before it by default.  Numbers are sizes if they lead from array to array to
    the end of the file.  Two of them before floating-point numbers are sizes, too: as numbers they would be 1e-300.
    """
    size, row = path.stat().st_size, columns * dtype.itemsize
    with open_file(path) as file:
        sized, end = _sized(file, size, dtype, columns)
    if sized and (end == size or (columns > 1 and dtype.kind == "f")):
        if end < size:
            arrays = f"{len(sized)} arrays of {columns} columns, each with its size before it"
            remedy = "correct `columns` in study.toml, or record it again"
            raise BadLog(f"{path}: after {arrays}, byte {end} begins an array without {columns} columns; {remedy}")
        position, rows = sized[-1]
        whole = min(rows, (size - position) // row)
        lost = (size - position) % row if whole < rows else 0
        return [*sized[:-1], (position, whole)], f"{len(sized)} arrays, each with its size before it", lost
    if size < row:
        raise BadLog(f"{path}: its {size} bytes are fewer than one row of {columns} numbers of {dtype.itemsize} bytes")
    return [(0, size // row)], f"rows of {columns} numbers", size % row


def _sized(file: BinaryIO, size: int, dtype: np.dtype[np.generic], columns: int) -> tuple[Pieces, int]:
    """Follow arrays with their sizes before them, and return where they end; the last one may be cut."""
    number = np.dtype(("<" if dtype.str[0] == "<" else ">") + "i4")
    dimensions = 1 if columns == 1 else 2
    pieces: Pieces = []
    position = 0
    while position + dimensions * number.itemsize <= size:
        file.seek(position)
        rows, *others = np.frombuffer(file.read(dimensions * number.itemsize), number).tolist()
        if rows < 0 or others not in ([], [columns]):
            break
        position += dimensions * number.itemsize
        pieces.append((position, rows))
        position += rows * columns * dtype.itemsize
    cut = position > size and columns > 1
    return pieces, size if cut else position
