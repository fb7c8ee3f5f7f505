"""The samples of TDMS regions as numbers, in pieces of bounded size, and channels of different lengths side by side."""

from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from davinci_forces.logs.log import Block
from davinci_forces.logs.tdms.walk import BLOCK, Column, Region

ROWS = 1 << 17  # of a piece
VALUES = 1 << 20  # of a block
FAR = 1 << 16  # [bytes] between what is wanted of two records, which cost more to read than to pass over


def rows_of(channels: int) -> int:
    """Rows of a block of so many channels."""
    return min(ROWS, VALUES // max(channels, 1) + 1)


def pieces(file: BinaryIO, regions: Iterator[Region], paths: Sequence[str], origin: int) -> Iterator[Block]:
    """The samples of channels that always come together, as many of each in every piece.

    `origin` is the second since 1904 that time stamps are counted from.
    """
    for region in regions:
        columns = {path: region.columns[path] for path in paths if path in region.columns}
        if not columns:
            continue
        dense = all(column.step == column.dtype.itemsize for column in columns.values())
        read = _slices if dense and region.stride > BLOCK else _records
        for views in read(file, region, columns):
            yield {path: _numbers(view, origin) for path, view in views.items()}


def _records(file: BinaryIO, region: Region, columns: dict[str, Column]) -> Iterator[dict[str, NDArray[Any]]]:
    """Many whole records at a time."""
    widest = max(column.count for column in columns.values())
    many = max(1, min(BLOCK // region.stride, ROWS // max(widest, 1)))
    begin = min(column.offset for column in columns.values())
    needed = max(
        column.offset + (column.count - 1) * column.step + column.dtype.itemsize for column in columns.values()
    )
    span = needed - begin
    apart = region.stride - span > FAR
    for first in range(0, region.records, many):
        records, start = min(many, region.records - first), region.position + first * region.stride + begin
        if apart:
            raw = b"".join(_read(file, start + i * region.stride, span) for i in range(records))
        else:
            raw = _read(file, start, (records - 1) * region.stride + span)
        stride = span if apart else region.stride
        yield {path: _view(raw, records, stride, column, begin) for path, column in columns.items()}


def _read(file: BinaryIO, position: int, octets: int) -> bytes:
    file.seek(position)
    return file.read(octets)


def _view(raw: bytes, records: int, stride: int, column: Column, begin: int) -> NDArray[Any]:
    shape = (records, column.count)
    if not column.count:
        return np.empty(shape, column.dtype)
    return np.ndarray(shape, column.dtype, raw, offset=column.offset - begin, strides=(stride, column.step))


def _slices(file: BinaryIO, region: Region, columns: dict[str, Column]) -> Iterator[dict[str, NDArray[Any]]]:
    """Records that are too large to be read whole: a slice of every channel at a time."""
    most, rows = max(column.count for column in columns.values()), rows_of(len(columns))
    for record in range(region.records):
        start = region.position + record * region.stride
        for first in range(0, most, rows):
            yield {path: _slice(file, start, column, first, rows) for path, column in columns.items()}


def _slice(file: BinaryIO, start: int, column: Column, first: int, rows: int) -> NDArray[Any]:
    count = max(0, min(rows, column.count - first))
    return np.frombuffer(
        _read(file, start + column.offset + first * column.step, count * column.dtype.itemsize), column.dtype
    )


def _numbers(samples: NDArray[Any], origin: int) -> NDArray[np.float64]:
    if samples.dtype.names:
        samples = (samples["seconds"] - origin) + samples["fraction"] / 2.0**64
    return samples.astype(np.float64).reshape(-1)  # a copy, so that the rest of what was read is let go


class Queue:
    """The samples of some channels that came and are not handed on yet."""

    def __init__(self, source: Iterator[Block], paths: Sequence[str]) -> None:
        self.source, self.paths = source, paths
        self.parts: list[Block] = []
        self.length, self.ended = 0, False

    def fill(self, rows: int) -> None:
        """Read until there is a block's worth, or the end."""
        while self.length < rows and not self.ended:
            part = next(self.source, None)
            if part is None:
                self.ended = True
            else:
                self.parts.append(part)
                self.length += len(part[self.paths[0]])

    def take(self, rows: int) -> tuple[Block, int]:
        """The next rows, filled up with NaN behind the end, and how many are filled up."""
        lacking = max(0, rows - self.length)
        whole = {path: np.concatenate([part[path] for part in self.parts] or [np.empty(0)]) for path in self.paths}
        self.parts = [{path: samples[rows:] for path, samples in whole.items()}] if self.length > rows else []
        self.length = max(0, self.length - rows)
        fill = np.full(lacking, np.nan)
        return {p: np.concatenate((s[:rows], fill)) if lacking else s[:rows] for p, s in whole.items()}, lacking


def side_by_side(queues: Sequence[Queue], most: int = ROWS) -> Iterator[tuple[Block, dict[str, int]]]:
    """Blocks of all channels, of about `most` rows, and how many samples each lacks, until the longest ends."""
    while True:
        for queue in queues:
            queue.fill(most)
        going = [queue.length for queue in queues if not queue.ended]
        rows = min(going) if going else max((queue.length for queue in queues), default=0)
        if not rows:
            return
        block: Block = {}
        lacking: dict[str, int] = {}
        for queue in queues:
            part, short = queue.take(rows)
            block |= part
            lacking |= dict.fromkeys(queue.paths, short)
        yield block, lacking
