"""Scan a file of records for its messages, without its index, as far as the records are whole."""

import bz2
import struct
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

try:
    from compression import zstd  # type: ignore[import-not-found,unused-ignore]  # from Python 3.14
except ImportError:
    from backports import zstd

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import BadContent
from davinci_forces.maths.arrays import Integers

Table = Callable[[Integers], NDArray[np.uint8]]  # from numbers of messages of one size to their bytes, a row each
DECOMPRESSORS: dict[str, Any] = {
    "bz2": bz2.BZ2Decompressor, "lz4": lz4.frame.LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor,
}  # fmt: skip
DECOMPRESSION_ERRORS = (OSError, RuntimeError, ValueError, EOFError, zstd.ZstdError)  # raised by decompressors
MALFORMED = (struct.error, KeyError, IndexError, ValueError)  # raised by records that are no records
CACHED_CHUNKS = 4
BATCH_MESSAGES = 1 << 13  # messages that are read at a time
BATCH_BYTES = 1 << 24  # and their size, whichever is reached first
MAX_SIZES = 32  # messages of different sizes that stand for a topic


def decompress(content: bytes) -> bytes:
    """Decompress a message or a file of zstd."""
    return bytes(zstd.decompress(content))


@dataclass(frozen=True)
class Chunk:
    """Records that are compressed together; `whole` is False where the file ends in it."""

    compression: str
    content: memoryview
    size: int
    whole: bool = True

    def unpack(self) -> memoryview:
        """Decompress it, of a chunk that is not whole as much as there is."""
        if self.compression in ("", "none"):
            unpacked = self.content
        elif self.compression not in DECOMPRESSORS:
            raise BadContent(f"a chunk is compressed by {self.compression!r}, which is not supported")
        else:
            try:
                decompressor = DECOMPRESSORS[self.compression]()
                unpacked = memoryview(decompressor.decompress(self.content, max_length=self.size + 1))
            except DECOMPRESSION_ERRORS as error:
                raise BadContent(f"a chunk cannot be decompressed ({error})") from None
        if self.whole and len(unpacked) != self.size:
            raise BadContent(f"a chunk holds {len(unpacked)} bytes instead of {self.size}")
        return unpacked


@dataclass(frozen=True)
class Batch:
    """Messages in the order of time: numbers of their connections, times of receipt [ns since 1970], sizes [bytes]."""

    owners: Sequence[int]
    times: Integers
    sizes: Integers
    table: Table


@dataclass
class Scan:
    """The messages of a file of records, by connection."""

    path: Path
    connections: list[Any] = field(default_factory=list)  # name, type, definition and encoding of topics
    warnings: list[str] = field(default_factory=list)
    cut: bool = False
    chunks: list[Chunk] = field(default_factory=list)  # the first is the file
    places: dict[int, "array[int]"] = field(default_factory=dict)  # time, chunk, begin and end of messages
    at: int = 0  # where scanning ended
    chunk: int = 0  # that is scanned

    def open(self) -> None:
        """Scan the file; raises BadLog if it is damaged, which a file that ends too early is not."""
        with open_file(self.path) as file:
            content = memoryview(mmap(file.fileno(), 0, access=ACCESS_READ))
        self.chunks = [Chunk("", content, len(content))]
        self.unpacked: dict[int, memoryview] = {}
        problem = ""
        try:
            self.scan(content)
        except BadContent as damage:
            problem = str(damage)
        except MALFORMED as error:
            problem = f"a record is not whole: {error}"
        if problem and self.is_closed(content):
            raise BadLog(f"{self.path}: this bag is damaged at byte {self.at} ({problem}); record it again")
        if problem or not self.is_closed(content):
            self.cut = True
            times = [t for places in self.places.values() for t in places[::4]]
            span = (max(times) - min(times)) / 1e9 if times else 0.0
            messages = f"{len(times)} messages over {span:.3f} s are whole and are read"
            end = f"up to byte {self.at} of {len(content)}"
            self.warnings.append(f"{self.path.name} is cut, or its recorder did not close it: {messages}, {end}")
        else:
            self.compare()
        self.connections = [c._replace(msgcount=len(self.places[c.id]) // 4) for c in self.connections]

    def scan(self, content: memoryview) -> None:
        """Go through the records of the file."""
        raise NotImplementedError

    def is_closed(self, content: memoryview) -> bool:
        """Whether the recorder closed the file, and its end is there."""
        raise NotImplementedError

    def compare(self) -> None:
        """Compare the messages with what the closed file says of them; raises BadLog."""
        raise NotImplementedError

    def require_count(self, where: str, topic: str, stated: int, count: int) -> None:
        """Require that as many messages are there as the file states."""
        if stated != count:
            counts = f"{where} counts {stated} messages of {topic}, but {count} are there"
            raise BadLog(f"{self.path}: {counts}; the bag is damaged: record it again")

    def add(self, connection: Any) -> None:
        """Add a connection, unless it is there: bags repeat them."""
        if connection.id not in self.places:
            self.places[connection.id] = array("q")
            self.connections.append(connection)

    def place(self, connection: int, time: int, begin: int, end: int) -> None:
        """Add the place of a message in the chunk that was opened last."""
        try:
            self.places[connection].extend((time, self.chunk, begin, end))
        except (KeyError, OverflowError):
            raise BadContent("a message is of an unknown topic or time") from None

    def content_of(self, number: int) -> memoryview:
        """The content of a chunk; a few are kept."""
        if number not in self.unpacked:
            if len(self.unpacked) >= CACHED_CHUNKS:
                del self.unpacked[next(iter(self.unpacked))]
            self.unpacked[number] = self.chunks[number].unpack()
        return self.unpacked[number]

    def batches(self, connections: Sequence[Any]) -> Iterator[Batch]:
        """Yield the messages of some connections in the order of time."""
        each = [np.frombuffer(self.places[c.id], np.int64).reshape(-1, 4) for c in connections]
        owners = np.repeat(np.arange(len(each)), [len(places) for places in each])
        places = np.concatenate(each)
        order = np.lexsort((places[:, 2], places[:, 1], places[:, 0]))
        largest = int((places[:, 3] - places[:, 2]).max(initial=1))
        step = max(1, min(BATCH_MESSAGES, BATCH_BYTES // largest))
        for first in range(0, len(order), step):
            part = order[first : first + step]
            time, chunk, begin, end = places[part].T
            table = partial(self._table, chunk, begin, end - begin)
            yield Batch(owners[part].tolist(), time, end - begin, table)

    def _table(self, chunks: Integers, begins: Integers, sizes: Integers, rows: Integers) -> NDArray[np.uint8]:
        """Bytes of messages of one size, a row each: copied row by row, without an object for each."""
        table = np.empty((len(rows), sizes[rows[0]]), np.uint8)
        for chunk in np.unique(chunks[rows]) if table.size else ():
            there = chunks[rows] == chunk
            content = np.frombuffer(self.content_of(int(chunk)), np.uint8)
            table[there] = sliding_window_view(content, table.shape[1])[begins[rows[there]]]
        return table

    def samples(self, connection: Any) -> list[tuple[int, bytes]]:
        """Time and content of the first message, and of one message of other sizes."""
        places = np.frombuffer(self.places[connection.id], np.int64).reshape(-1, 4)
        places = places[np.argsort(places[:, 0], kind="stable")]
        first = np.sort(np.unique(places[:, 3] - places[:, 2], return_index=True)[1])[:MAX_SIZES]
        return [(time, bytes(self.content_of(chunk)[begin:end])) for time, chunk, begin, end in places[first].tolist()]

    def close(self) -> None:
        """Release the file."""
        self.chunks.clear()
        self.unpacked.clear()
