"""Scan the records of an MCAP file, and check them by its checksums and statistics."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from zlib import crc32

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat

from davinci_forces.logs.log import BadContent
from davinci_forces.logs.ros.scan import Chunk, Scan

MCAP_MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE_OF_MCAP, CHUNK_OF_MCAP, STATISTICS, DATA_END = 2, 3, 4, 5, 6, 11, 15
MESSAGE_HEADER = struct.Struct("<HIQQ")
CHUNK_HEADER = struct.Struct("<QQQI")
FORMATS_OF_DEFINITIONS = {
    "ros1msg": MessageDefinitionFormat.MSG, "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL, "omgidl": MessageDefinitionFormat.IDL,
}  # fmt: skip


@dataclass
class Mcap(Scan):
    """A file of MCAP."""

    schemas: dict[int, tuple[str, MessageDefinition]] = field(default_factory=dict)
    total: int | None = None  # messages that the statistics count
    stated: dict[int, int] = field(default_factory=dict)  # and of each connection; a recorder need not write them

    def scan(self, content: memoryview) -> None:
        """Go through the records of the file, and of its chunks."""
        self.at = len(MCAP_MAGIC)
        for kind, begin, end in _records(content, self.at):
            record = content[begin:end]
            if kind == CHUNK_OF_MCAP:
                self._scan_chunk(record, end <= len(content))
            elif kind == STATISTICS:
                self.total = struct.unpack_from("<Q", record)[0]
                self.stated = dict(struct.iter_unpack("<HQ", record[46 : 46 + struct.unpack_from("<I", record, 42)[0]]))
            elif kind == DATA_END:
                _require_crc(struct.unpack("<I", record)[0], content[: begin - 9], "the data")
            elif kind == FOOTER:
                summary, _, crc = struct.unpack("<QQI", record)
                _require_crc(crc, content[summary or begin - 9 : end - 4], "the summary")
                if content[end:] != MCAP_MAGIC:
                    raise BadContent("it does not end as MCAP ends")
                return
            else:
                self._take(kind, record, begin, end)
            self.at = end

    def is_closed(self, content: memoryview) -> bool:
        """Whether the file ends as the recorder ends it."""
        return len(content) > len(MCAP_MAGIC) and content[-len(MCAP_MAGIC) :] == MCAP_MAGIC

    def compare(self) -> None:
        """Compare the messages with the statistics."""
        counts = {connection.id: len(self.places[connection.id]) // 4 for connection in self.connections}
        for connection in self.connections if self.stated else ():
            stated = self.stated.get(connection.id, 0)
            self.require_count("its statistics", connection.topic, stated, counts[connection.id])
        if self.total is not None:
            self.require_count("its statistics", "all topics", self.total, sum(counts.values()))

    def _scan_chunk(self, record: memoryview, whole: bool) -> None:
        _, _, size, crc = CHUNK_HEADER.unpack_from(record)
        compression, at = _text(record, CHUNK_HEADER.size)
        begin, length = at + 8, struct.unpack_from("<Q", record, at)[0]
        self.chunk = len(self.chunks)
        self.chunks.append(Chunk(compression, record[begin : begin + length], size, whole))
        records = self.content_of(self.chunk)
        if whole:
            _require_crc(crc, records, "a chunk")
        for kind, first, last in _records(records, 0):
            if kind == CHUNK_OF_MCAP:
                raise BadContent("a chunk is in a chunk")
            self._take(kind, records[first:last], first, last)
        self.chunk = 0
        if not whole:
            raise BadContent("the file ends in a chunk")

    def _take(self, kind: int, record: memoryview, begin: int, end: int) -> None:
        if kind == MESSAGE_OF_MCAP:
            connection, _, time, _ = MESSAGE_HEADER.unpack_from(record)
            self.place(connection, time, begin + MESSAGE_HEADER.size, end)
        elif kind == SCHEMA:
            name, at = _text(record, 2)
            encoding, at = _text(record, at)
            length = struct.unpack_from("<I", record, at)[0]
            known = FORMATS_OF_DEFINITIONS.get(encoding, MessageDefinitionFormat.NONE)
            text = bytes(record[at + 4 : at + 4 + length]).decode() if encoding in FORMATS_OF_DEFINITIONS else ""
            self.schemas[struct.unpack_from("<H", record)[0]] = (name, MessageDefinition(known, text))
        elif kind == CHANNEL:
            connection, schema = struct.unpack_from("<HH", record)
            topic, at = _text(record, 4)
            name, definition = self.schemas.get(schema, ("", MessageDefinition(MessageDefinitionFormat.NONE, "")))
            self.add(Connection(connection, topic, name, definition, "", 0, _text(record, at)[0], self))


def _records(content: memoryview, at: int) -> Iterator[tuple[int, int, int]]:
    """Yield the kind of each record, and where its content is; only a chunk may end beyond the content."""
    while at < len(content):
        kind, length = struct.unpack_from("<BQ", content, at)
        begin, end = at + 9, at + 9 + length
        if end > len(content) and kind != CHUNK_OF_MCAP:
            raise BadContent("a record ends beyond the file")
        yield kind, begin, end
        at = end


def _text(record: memoryview, at: int) -> tuple[str, int]:
    """A text behind its length, and where it ends."""
    end = at + 4 + struct.unpack_from("<I", record, at)[0]
    if end > len(record):
        raise BadContent("a text ends beyond its record")
    return bytes(record[at + 4 : end]).decode(), end


def _require_crc(stated: int, content: memoryview, what: str) -> None:
    """Require that the checksum is the one that the file states; 0 states none."""
    if stated and crc32(content) != stated:
        raise BadContent(f"the checksum of {what} does not match")
