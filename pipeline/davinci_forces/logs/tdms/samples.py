"""Index the samples of a TDMS file, so that any channel is read without the others, in pieces of bounded size.

npTDMS reads channels that need a scale: raw values of DAQ cards, and scales described in the file.  It always gets the
open file, never its path: it would trust an index file in the same folder, however old or damaged.
"""

import logging
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from mmap import ACCESS_READ, mmap
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from davinci_forces.logs.log import Block, concatenate, row_count
from davinci_forces.logs.tdms.metadata import names
from davinci_forces.logs.tdms.walk import BLOCK, Column, Region, read_at

PIECE_ROWS = 1 << 17  # of a piece
BLOCK_VALUES = 1 << 20  # of a block
MIN_SKIP = 1 << 16  # [bytes] between the wanted parts of two records; beyond this gap, skipping is faster than reading
COUNT = "NI_Number_Of_Scales"
NUMBERED = re.compile(r"NI_Scale\[(\d{1,6})\]_")
MAX_SCALES = 1000  # scales of a channel
# The scales that npTDMS applies; it would return values of any other scale unscaled.
SCALES = frozenset(
    ["Polynomial", "Linear", "RTD", "Strain", "Table", "Thermistor", "Thermocouple", "Add", "Subtract", "AdvancedAPI"]
)


@dataclass
class Index:
    """The regions of a file, four numbers each, so that millions of them fit in memory."""

    kinds: list[Region] = field(default_factory=list)  # the first region with these columns and counts
    _numbers: dict[tuple[object, ...], int] = field(default_factory=dict)  # of the kinds
    _regions: "array[int]" = field(default_factory=lambda: array("q"))  # position, records, stride and kind of each

    def add(self, region: Region) -> None:
        """Add a region."""
        kind = self._numbers.setdefault((*region.columns.items(), *region.counts.items()), len(self.kinds))
        if kind == len(self.kinds):
            self.kinds.append(region)
        self._regions.extend((region.position, region.records, region.stride, kind))

    def groups(self, paths: Sequence[str]) -> list[list[str]]:
        """Group channels with equal numbers of samples in every record, which can be read in one pass."""
        groups: dict[tuple[int, ...], list[str]] = {}
        for path in paths:
            groups.setdefault(tuple(kind.counts.get(path, 0) for kind in self.kinds), []).append(path)
        return list(groups.values())

    def regions(self, path: str) -> Iterator[Region]:
        """Yield the regions with samples of a channel, in order."""
        for position, records, stride, number in zip(*[iter(self._regions)] * 4, strict=True):
            kind = self.kinds[number]
            if kind.counts.get(path):
                yield Region(position, records, stride, kind.columns, kind.counts)


def rows_of(channels: int) -> int:
    """Number of rows of a block of so many channels."""
    return min(PIECE_ROWS, BLOCK_VALUES // max(channels, 1) + 1)


def pieces(file: BinaryIO, regions: Iterator[Region], paths: Sequence[str], origin: int) -> Iterator[Block]:
    """Read the samples of channels of one group; `origin` is the zero of time stamps, in seconds since 1904."""
    for region in regions:
        columns = {path: region.columns[path] for path in paths if path in region.columns}
        if not columns:
            continue
        dense = all(column.step == column.dtype.itemsize for column in columns.values())
        read = _slices if dense and region.stride > BLOCK else _records
        for views in read(file, region, columns):
            yield {path: _numbers(view, origin) for path, view in views.items()}


def _records(file: BinaryIO, region: Region, columns: dict[str, Column]) -> Iterator[dict[str, NDArray[Any]]]:
    most = max(column.count for column in columns.values())
    many = max(1, min(BLOCK // region.stride, PIECE_ROWS // most))
    begin = min(column.offset for column in columns.values())
    end = max(column.offset + (column.count - 1) * column.step + column.dtype.itemsize for column in columns.values())
    span = end - begin
    apart = region.stride - span > MIN_SKIP
    stride = span if apart else region.stride
    for first in range(0, region.records, many):
        records, start = min(many, region.records - first), region.position + first * region.stride + begin
        if apart:
            raw = b"".join(read_at(file, start + i * region.stride, span) for i in range(records))
        else:
            raw = read_at(file, start, (records - 1) * region.stride + span)
        yield {
            path: np.ndarray((records, c.count), c.dtype, raw, c.offset - begin, (stride, c.step))
            for path, c in columns.items()
        }


def _slices(file: BinaryIO, region: Region, columns: dict[str, Column]) -> Iterator[dict[str, NDArray[Any]]]:
    """Read records too large for memory: a slice of every channel at a time."""
    count, rows = max(column.count for column in columns.values()), rows_of(len(columns))
    for record in range(region.records):
        start = region.position + record * region.stride
        for first in range(0, count, rows):
            many = min(rows, count - first)
            yield {
                path: np.frombuffer(read_at(file, start + c.offset + first * c.step, many * c.step), c.dtype)
                for path, c in columns.items()
            }


def _numbers(samples: NDArray[Any], origin: int) -> NDArray[np.float64]:
    if samples.dtype.names:
        samples = (samples["seconds"] - origin) + samples["fraction"] / 2.0**64
    return samples.astype(np.float64).reshape(-1)  # a copy, so that the bytes read can be freed


def side_by_side(
    sources: Sequence[Iterator[Block]], groups: Sequence[Sequence[str]], rows: int
) -> Iterator[tuple[Block, dict[str, int]]]:
    """Yield blocks of the channels of all groups, with the missing samples of each: shorter ones end in NaN."""
    for parts in zip_longest(*(_recut(source, rows) for source in sources), fillvalue=Block()):
        count = max(map(row_count, parts))
        block: Block = {}
        lacking: dict[str, int] = {}
        for group, part in zip(groups, parts, strict=True):
            fill = np.full(count - row_count(part), np.nan)
            lacking |= dict.fromkeys(group, len(fill))
            block |= {p: np.concatenate((part[p], fill)) if part else fill for p in group} if len(fill) else part
        yield block, lacking


def _recut(source: Iterator[Block], rows: int) -> Iterator[Block]:
    waiting: list[Block] = []
    length = 0
    for piece in source:
        waiting.append(piece)
        length += row_count(piece)
        if length >= rows:
            whole = concatenate(waiting)
            *cuts, rest = (slice(first, first + rows) for first in range(0, length + 1, rows))
            waiting, length = [{path: samples[rest] for path, samples in whole.items()}], length % rows
            yield from ({path: samples[cut] for path, samples in whole.items()} for cut in cuts)
    if length:
        yield concatenate(waiting)


class Part(mmap):
    """The first bytes of a file, for a reader that must not see the damage after them."""

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer as far as there are bytes."""
        data = self.read(len(buffer))
        buffer[: len(data)] = np.frombuffer(data, np.uint8)
        return len(data)


def is_scaled(properties: dict[str, Any]) -> bool:
    """Whether the values still have to be scaled by the properties."""
    has_scale = properties.get(COUNT, 0) not in (0, "0") or any(name.endswith("_Scale_Type") for name in properties)
    return has_scale and properties.get("NI_Scaling_Status", "unscaled") != "scaled"


def problem(properties: dict[str, Any]) -> str:
    """Return why the scales cannot be applied, or ""; with a damaged count npTDMS would look for billions."""
    kinds = {str(value) for name, value in properties.items() if name.endswith("_Scale_Type")}
    if unknown := sorted(kinds - SCALES):
        return f"has a scale of unknown kind: {', '.join(unknown)}"
    numbers = [int(match[1]) for name in properties if (match := NUMBERED.match(name))]
    count, most = properties.get(COUNT, 0), max([0, *numbers]) + 1
    if not isinstance(count, int) or not 0 <= count <= min(most, MAX_SCALES):
        return f"claims {count!r} scales but describes {len(kinds)}: the file is damaged; record it again"
    return ""


def apply_scales(read: Iterator[Block], scales: Mapping[str, dict[str, Any]]) -> Iterator[Block]:
    """Scale the samples of some channels, of which npTDMS itself would read the whole chunk for every piece of it."""
    from nptdms.base_segment import RawChannelDataChunk
    from nptdms.scaling import get_scaling

    scalings = {path: scaling for path, properties in scales.items() if (scaling := get_scaling(properties, {}, {}))}
    for piece in read:
        raw = {path: RawChannelDataChunk.channel_data(piece[path]) for path in scalings}
        yield piece | {path: np.asarray(scaling.scale(raw[path]), np.float64) for path, scaling in scalings.items()}


def scaled_pieces(file: BinaryIO, size: int, paths: Sequence[str], chunk: int) -> Iterator[Block]:
    """Read the scaled samples of channels of one group; `chunk` is the number of each in one chunk."""
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.set_level(logging.ERROR)  # problems of the file are reported already
    with TdmsFile.open(Part(file.fileno(), size, access=ACCESS_READ)) as opened:
        name_of = {path: names(path) for path in paths}
        if chunk <= PIECE_ROWS:
            for part in opened.data_chunks():
                yield {path: np.asarray(part[g][c][:], dtype=np.float64) for path, (g, c) in name_of.items()}
            return
        channels = {path: opened[group][channel] for path, (group, channel) in name_of.items()}
        for first in range(0, len(channels[paths[0]]), PIECE_ROWS):
            yield {path: np.asarray(c[first : first + PIECE_ROWS], dtype=np.float64) for path, c in channels.items()}
