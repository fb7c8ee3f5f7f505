"""Walk the file segments of a TDMS file, and describe them as regions of equal records.

A control loop that writes one sample per call leaves millions of file segments or chunks.  Equal ones are found by
comparing whole blocks of the file and become one region, so that no loop runs over them.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO

import numpy as np

from davinci_forces.logs.log import BadContent
from davinci_forces.logs.tdms.metadata import DAQMX_RAW, NUMBER_CODES, SIZES, STRING, TIME, Objects, Samples

TAG = b"TDSm"
LEAD_IN = 28  # [bytes]
HAS_METADATA, HAS_NEW_LIST, HAS_RAW, IS_INTERLEAVED, IS_BIG_ENDIAN = 2, 4, 8, 32, 64
VERSIONS = [struct.pack(order + "I", version) for order in "<>" for version in (4712, 4713)]
UNKNOWN = 2**64 - 1  # length of a file segment that LabVIEW did not finish
SMALL_SEGMENT = 1 << 14  # [bytes] of a file segment that is compared in blocks
BLOCK = 8 << 20


@dataclass(frozen=True)
class Column:
    """Position of the samples of a channel in a record."""

    dtype: np.dtype[Any]
    offset: int  # of the first
    step: int  # from one to the next
    count: int


@dataclass(frozen=True)
class Region:
    """Consecutive records of equal size."""

    position: int  # of the first
    records: int
    stride: int  # from one record to the next
    columns: dict[str, Column]  # by path, without channels whose samples are not plain numbers
    counts: dict[str, int]  # samples of every channel in one record


@dataclass
class Walk:
    """A pass over the file segments of a file of `size` bytes; `say` gets the reason if it ends early."""

    file: BinaryIO
    size: int
    say: Callable[[str], None]
    objects: Objects = field(default_factory=Objects)
    file_segments: int = 0
    layouts: set[str] = field(default_factory=set)
    end: int = 0  # of the last whole file segment, or of the file
    cut: bool = False  # a file segment lacks some of its samples

    def regions(self) -> Iterator[Region]:
        """Yield the regions of the file, in order."""
        at = 0
        while at < self.size:
            lead = read_at(self.file, at, LEAD_IN)
            if not lead.startswith(TAG) or len(lead) < LEAD_IN:
                return self._stop(at, lead)
            toc = int.from_bytes(lead[4:8], "little")
            order = ">" if toc & IS_BIG_ENDIAN else "<"
            length, raw = struct.unpack(order + "QQ", lead[12:])
            data, end = at + LEAD_IN + raw, at + LEAD_IN + length
            whole = length != UNKNOWN and end <= self.size
            if data > self.size or (length != UNKNOWN and raw > length):
                return self._stop(at, lead)
            if not whole:
                end = self._cut(at, data, length)
            metadata = read_at(self.file, at + LEAD_IN, raw)
            try:
                if toc & HAS_METADATA:
                    self.objects.update(metadata, order, bool(toc & HAS_NEW_LIST))
                more = self._alike(lead + metadata, end, LEAD_IN + length) if whole else 0
                yield from self._within(toc, order, data, end, more, LEAD_IN + length, whole)
            except BadContent as problem:
                what = f"the file segment that begins here is damaged: {problem}"
                self.say(f"byte {at}: {what}; neither it nor the data after it is read")
                return None
            self.file_segments += 1 + more
            at = self.end = end + more * (LEAD_IN + length)
        return None

    def _stop(self, at: int, lead: bytes) -> None:
        size = self.size - at
        what = f"no file segment begins here: the file is damaged; the last {size} bytes are not read"
        if not lead.strip(b"\0"):
            what = f"{size} NUL bytes follow, typical of a power cut; they are not read"
        elif TAG.startswith(lead[:4]):
            what = f"the file is cut within the head of a file segment; its last {size} bytes are not read"
        self.say(f"byte {at}: {what}")

    def _cut(self, at: int, data: int, length: int) -> int:
        """Find the end of a file segment of unknown or too large length: the next one, or the end of the file."""
        self.cut = True
        end = self._next_tag(data)
        where = "the end of the file" if end == self.size else f"the next file segment, at byte {end}"
        short = at + LEAD_IN + length - end
        what = f"the file segment that begins here lacks {short} bytes; whole samples up to {where} are kept"
        if length == UNKNOWN:
            what = f"the length of the file segment that begins here was never written; read up to {where}"
        self.say(f"byte {at}: {what}")
        return end

    def _next_tag(self, at: int) -> int:
        """Find the position of the next lead-in, or the end of the file."""
        while at < self.size:
            block = read_at(self.file, at, BLOCK)
            tag = block.find(TAG)
            while tag >= 0:
                if read_at(self.file, at + tag, 12)[8:] in VERSIONS:
                    return at + tag
                tag = block.find(TAG, tag + 1)
            at += max(len(block) - len(TAG) + 1, 1)
        return self.size

    def _alike(self, head: bytes, at: int, stride: int) -> int:
        """Count the following file segments with the same lead-in and metadata."""
        alike, window = 0, stride  # the window grows, so that a file of unequal file segments is not read many times
        while True:
            many = min(self.size - at, window) // stride
            same = self._same(head, at, stride, many)
            alike, at = alike + same, at + same * stride
            if same < many or not many:
                return alike
            window = max(min(2 * window, BLOCK), stride)

    def _same(self, head: bytes, at: int, stride: int, many: int) -> int:
        """Count the next file segments that begin like this: compared at once if small, else one by one."""
        if stride > SMALL_SEGMENT:
            return next((i for i in range(many) if read_at(self.file, at + i * stride, len(head)) != head), many)
        block = np.frombuffer(read_at(self.file, at, many * stride), np.uint8).reshape(many, stride)
        differ = np.flatnonzero((block[:, : len(head)] != np.frombuffer(head, np.uint8)).any(axis=1))
        return int(differ[0]) if len(differ) else many

    def _within(
        self, toc: int, order: str, data: int, end: int, more: int, stride: int, whole: bool
    ) -> Iterator[Region]:
        """Yield the regions of a file segment and of the `more` equal ones after it, `stride` bytes apart."""
        active = self.objects.active
        if not toc & HAS_RAW or not active:
            return
        interleaved = bool(toc & IS_INTERLEAVED) and DAQMX_RAW not in {samples.kind for samples in active.values()}
        self.layouts |= {"interleaved" if interleaved else "contiguous"} | ({"big-endian"} if order == ">" else set())
        length = end - data
        read = _interleaved(active, order, data, length) if interleaved else _chunks(active, order, data, length, whole)
        regions = list(read)
        if more and len(regions) == 1 and stride <= BLOCK and (joined := _joined(regions[0], 1 + more, stride)):
            yield joined
            return
        for i in range(1 + more):
            for region in regions:
                yield replace(region, position=region.position + i * stride)


def read_at(file: BinaryIO, position: int, octets: int) -> bytes:
    """Read so many bytes from a position on, or as many as there are."""
    file.seek(position)
    return file.read(octets)


def _chunks(active: dict[str, Samples], order: str, data: int, length: int, whole: bool) -> Iterator[Region]:
    cards = {samples.widths: samples.count for samples in active.values() if samples.kind == DAQMX_RAW}
    size = sum(samples.octets for samples in active.values()) + sum(sum(w) * count for w, count in cards.items())
    chunks, remainder = divmod(length, size) if size else (0, 0)
    counts = {path: samples.count for path, samples in active.items()}
    if chunks:
        yield Region(data, chunks, size, _contiguous(active, counts, order), counts)
    if remainder:
        counts = _left_over(active, remainder, size, whole)
        yield Region(data + chunks * size, 1, remainder, _contiguous(active, counts, order), counts)


def _interleaved(active: dict[str, Samples], order: str, data: int, length: int) -> Iterator[Region]:
    """Yield interleaved data, one record per row, without an incomplete last row."""
    sizes = {path: SIZES.get(samples.kind, 0) for path, samples in active.items()}
    row = sum(sizes.values())
    if len({samples.count for samples in active.values()}) > 1 or not all(sizes.values()):
        raise BadContent("interleaved channels of unequal lengths, or of text")
    offsets = np.cumsum([0, *sizes.values()]).tolist()
    columns = {
        path: Column(dtype, offset, row, 1)
        for (path, samples), offset in zip(active.items(), offsets, strict=False)
        if (dtype := _dtype(samples.kind, order))
    }
    if length // row:
        yield Region(data, length // row, row, columns, dict.fromkeys(active, 1))


def _contiguous(active: dict[str, Samples], counts: dict[str, int], order: str) -> dict[str, Column]:
    """Locate the channels of a chunk, which lie one after the other."""
    columns, offset = {}, 0
    for path, samples in active.items():
        count = counts[path]
        if dtype := _dtype(samples.kind, order):
            columns[path] = Column(dtype, offset, dtype.itemsize, count)
        offset += samples.octets if samples.kind == STRING else count * SIZES.get(samples.kind, 0)
    return columns


def _left_over(active: dict[str, Samples], remaining: int, size: int, whole: bool) -> dict[str, int]:
    """Count the samples in the shorter last chunk of a file segment, of `remaining` bytes.

    A recorder that ended normally divides these over all channels; a truncated file holds the first channels
    completely and nothing of the last ones.
    """
    kinds = {samples.kind for samples in active.values()}
    if STRING in kinds:
        return dict.fromkeys(active, 0)
    if whole or DAQMX_RAW in kinds:
        return {path: samples.count * remaining // size for path, samples in active.items()}
    counts = {}
    for path, samples in active.items():
        counts[path] = min(samples.count, remaining // SIZES.get(samples.kind, 0))
        remaining = max(remaining - samples.octets, 0)
    return counts


def _joined(region: Region, file_segments: int, stride: int) -> Region | None:
    """Join equal file segments into a region, one record each, if each channel's samples are evenly spaced."""
    if region.records > 1 and any(column.count > 1 for column in region.columns.values()):
        return None
    columns = region.columns
    if region.records > 1:
        columns = {path: replace(c, step=region.stride, count=region.records) for path, c in columns.items()}
    counts = {path: count * region.records for path, count in region.counts.items()}
    return Region(region.position, file_segments, stride, columns, counts)


def _dtype(kind: int, order: str) -> np.dtype[Any] | None:
    """Return the numpy type of samples; None if they are neither numbers nor times."""
    if kind == TIME:
        parts = [("fraction", order + "u8"), ("seconds", order + "i8")]
        return np.dtype(parts if order == "<" else parts[::-1])
    return np.dtype(order + NUMBER_CODES[kind]) if kind in NUMBER_CODES else None
