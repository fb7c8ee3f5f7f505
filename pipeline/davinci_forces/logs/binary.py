"""Raw binary numbers, as LabVIEW's Write to Binary File makes them; the study says what they are."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import Block, Channel, Log, Options, ahead, unique, unit_in

SUFFIXES = (".bin", ".dat")
# LabVIEW counts bits and numpy's short names count bytes, so that i8 and u8, which are both, are refused.
TYPES = {"dbl": "f8", "sgl": "f4", "double": "f8", "single": "f4", "float64": "f8", "float32": "f4", "f4": "f4",
         "f8": "f8", "int8": "i1", "uint8": "u1"}  # fmt: skip
TYPES |= {name: f"{sign}{bits // 8}" for sign, word in (("i", "int"), ("u", "uint")) for bits in (16, 32, 64)
          for name in (f"{word}{bits}", f"{sign}{bits}")}  # fmt: skip
TYPES |= {code: code for code in ("i2", "i4", "u2", "u4")}
CELLS = 1 << 20  # of a block
EXAMPLE = 'dtype = "float64" and columns = ["time", "q", "i"], or their number'


def recognises(path: Path, head: bytes) -> bool:
    """Whether the name says so, and the content is no text."""
    return path.suffix.lower() in SUFFIXES and bool(re.search(rb"[\x00-\x08\x0e-\x1a]", head))


def dtype_of(said: str) -> np.dtype[np.generic] | None:
    """The type of number that a word stands for, big-endian where it does not say; None where it stands for none.

    `float64`, `DBL` and `f8` are the same; `<` before any of them says little-endian.
    """
    order, word = (said[0], said[1:]) if said[:1] in ("<", ">") else (">", said)
    known = TYPES.get(word.lower())
    return np.dtype(order + known) if known else None


def read(path: Path, options: Options) -> Log:
    """Open the file: what the study says of it is held against its size.

    Raises
    ------
    BadLog
        If the study does not say what is in it, or its size is no whole number of rows.
    """
    dtype = dtype_of(options.dtype or "")
    if dtype is None or not options.columns:
        raise BadLog(
            f"{path}: raw binary numbers do not say what they are; say so in its [[log]] in study.toml: {EXAMPLE} "
            '(big-endian, as LabVIEW writes; "<float64" is little-endian)'
        )
    count = options.columns if isinstance(options.columns, int) else len(options.columns)
    names = [f"column_{i}" for i in range(count)] if isinstance(options.columns, int) else options.columns
    pieces, layout, lost = _pieces(path, dtype, count)
    channels = tuple(Channel(name, unit_in(name)) for name in unique(names))
    facts = {"type": f"{dtype.name}, {'little' if dtype.str[0] == '<' else 'big'}-endian", "layout": layout}
    log = BinaryLog(path, "binary", channels, facts=facts, dtype=dtype, pieces=pieces)
    if lost:
        log.cut = True
        log.warnings.append(f"the file ends within a row: its last {lost} bytes are not read")
    return log


@dataclass
class BinaryLog(Log):
    """An opened file of raw numbers, row after row."""

    dtype: np.dtype[np.generic] = field(default_factory=lambda: np.dtype(">f8"))
    pieces: list[tuple[int, int]] = field(default_factory=list)  # where each begins, and its rows

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says."""
        self._start_anew(names)
        yield from ahead(self._blocks(names))

    def _blocks(self, names: Sequence[str]) -> Iterator[Block]:
        number = {channel.name: i for i, channel in enumerate(self.channels)}
        with open_file(self.path) as file:
            for rows in self._rows(file):
                yield self.tallied({name: rows[:, number[name]].astype(np.float64) for name in names})

    def _rows(self, file: BinaryIO) -> Iterator[np.ndarray[tuple[int, int], np.dtype[np.generic]]]:
        """The rows of every piece, so many at a time."""
        columns = len(self.channels)
        most = max(1, CELLS // columns)
        for position, rows in self.pieces:
            file.seek(position)
            for first in range(0, rows, most):
                content = file.read(min(most, rows - first) * columns * self.dtype.itemsize)
                yield np.frombuffer(content, self.dtype).reshape(-1, columns)


Pieces = list[tuple[int, int]]


def _pieces(path: Path, dtype: np.dtype[np.generic], columns: int) -> tuple[Pieces, str, int]:
    """Where rows begin and how many there are; in words; and bytes at the end that are no whole row.

    LabVIEW puts the sizes of an array before it unless told not to.  Sizes that lead from array to array up to the end
    of the file are no chance, and neither are two before numbers that would be 1e-300 if they were numbers.
    """
    size, row = path.stat().st_size, columns * dtype.itemsize
    with open_file(path) as file:
        sized, end = _sized(file, size, dtype, columns)
    if sized and (end == size or (columns > 1 and dtype.kind == "f")):
        if end < size:
            raise BadLog(
                f"{path}: after {len(sized)} arrays of {columns} columns with their sizes before them, another begins "
                f"at byte {end} that is not of {columns} columns; correct `columns` in study.toml, or record it again"
            )
        position, rows = sized[-1]
        whole = min(rows, (size - position) // row)
        lost = (size - position) % row if whole < rows else 0
        return [*sized[:-1], (position, whole)], f"{len(sized)} arrays with their sizes before them", lost
    if size < row:
        raise BadLog(f"{path}: its {size} bytes are less than a row of {columns} numbers of {dtype.itemsize} bytes")
    return [(0, size // row)], f"rows of {columns} numbers", size % row


def _sized(file: BinaryIO, size: int, dtype: np.dtype[np.generic], columns: int) -> tuple[Pieces, int]:
    """Arrays with their sizes before them as far as they go, and where they end; the last one may be cut."""
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
