"""Scan the records of a bag of ROS 1, version 2.0."""

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat
from rosbags.typesys.msg import normalize_msgtype

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import BadContent
from davinci_forces.logs.ros.scan import Chunk, Scan

MAGIC_1 = b"#ROSBAG V2.0\n"
MESSAGE, BAG_RECORD, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7  # kinds of records
TIME_FIELD = b"\r\0\0\0time="  # with its length, before the 8 bytes of a time
U32, TWO_U32 = struct.Struct("<I").unpack_from, struct.Struct("<II").unpack
Fields = dict[bytes, bytes]


@dataclass
class Rosbag1(Scan):
    """A bag of ROS 1."""

    stated: dict[int, Counter[int]] = field(default_factory=dict)  # by the beginning of a chunk: messages by topic
    counts: dict[int, Counter[int]] = field(default_factory=dict)
    listed: int = 0  # connections outside of chunks
    index: int = 0  # its place; 0 in a bag that was not closed
    ends: tuple[int, int] = (0, 0)  # numbers of connections and chunks that the index lists

    def scan(self, content: memoryview) -> None:
        """Go through the records of the file, and of its chunks."""
        if content[: len(MAGIC_1)] != MAGIC_1:
            raise BadLog(f"{self.path}: its version is not 2.0; run `rosbag fix` on it")
        self.at = len(MAGIC_1)
        for fields, begin, end in self._records(content, self.at):
            kind = fields[b"op"][0]
            if kind == BAG_RECORD:
                if fields.get(b"encryptor"):
                    raise BadLog(f"{self.path}: it is encrypted, which is not supported; decrypt it first")
                self.index = int.from_bytes(fields[b"index_pos"], "little")
                self.ends = (U32(fields[b"conn_count"])[0], U32(fields[b"chunk_count"])[0])
            elif kind == CHUNK:
                self._scan_chunk(fields, content[begin:end], end <= len(content))
            elif kind == CHUNK_INFO:
                stated = Counter(dict(struct.iter_unpack("<II", content[begin:end])))
                self.stated[int.from_bytes(fields[b"chunk_pos"], "little")] = stated
            elif kind in (CONNECTION, MESSAGE):
                self.listed += kind == CONNECTION
                self._take(kind, fields, content, begin, end)
            elif kind != INDEX:
                raise BadContent(f"a record is of the unknown kind {kind}")
            self.at = min(end, len(content))

    def is_closed(self, content: memoryview) -> bool:
        """Whether the index of chunks is there, as the recorder writes it last."""
        if not 0 < self.index < len(content):
            return False
        return self.at < self.index or (self.listed >= self.ends[0] and len(self.stated) >= self.ends[1])

    def compare(self) -> None:
        """Compare the messages of each chunk with those that the index states."""
        for begin in self.stated.keys() | self.counts.keys():
            stated, counts = self.stated.get(begin, Counter()), self.counts.get(begin, Counter())
            for connection in stated.keys() | counts.keys():
                topic = next((c.topic for c in self.connections if c.id == connection), "an unknown topic")
                self.require_count("its index", topic, stated[connection], counts[connection])

    def _records(self, content: memoryview, at: int) -> Iterator[tuple[Fields, int, int]]:
        """Yield the fields of each record, and where its data are; only a chunk may end beyond the content."""
        size = len(content)
        while at < size:
            begin = at + 8 + U32(content, at)[0]
            end = begin + U32(content, begin - 4)[0]
            fields = _fields(content[at + 4 : begin - 4].tobytes())
            if end > size and fields[b"op"][0] != CHUNK:
                raise BadContent("a record ends beyond the file")
            yield fields, begin, end
            at = end

    def _scan_chunk(self, fields: Fields, content: memoryview, whole: bool) -> None:
        self.chunk = len(self.chunks)
        self.chunks.append(Chunk(fields[b"compression"].decode(), content, U32(fields[b"size"])[0], whole))
        records = self.content_of(self.chunk)
        before = Counter({c: len(places) // 4 for c, places in self.places.items()})
        for inner, begin, end in self._records(records, 0):
            if (kind := inner[b"op"][0]) not in (CONNECTION, MESSAGE):
                raise BadContent(f"a record of kind {kind} is in a chunk")
            self._take(kind, inner, records, begin, end)
        self.counts[self.at] = Counter({c: len(places) // 4 for c, places in self.places.items()}) - before
        self.chunk = 0
        if not whole:
            raise BadContent("the file ends in a chunk")

    def _take(self, kind: int, fields: Fields, content: memoryview, begin: int, end: int) -> None:
        connection = U32(fields[b"conn"])[0]
        if kind == MESSAGE:
            seconds, nanoseconds = TWO_U32(fields[b"time"])
            self.place(connection, seconds * 10**9 + nanoseconds, begin, end)
            return
        about = _fields(bytes(content[begin:end]))
        definition = MessageDefinition(MessageDefinitionFormat.MSG, about[b"message_definition"].decode())
        kind_of = normalize_msgtype(about[b"type"].decode())
        self.add(Connection(connection, fields[b"topic"].decode(), kind_of, definition, "", 0, "ros1", self))


def _fields(header: bytes) -> Fields:
    """Read `name=value` fields, each behind its length; those of messages differ in their last, the time, alone."""
    if header[-17:-8] == TIME_FIELD:
        return _fields_before(header[:-17]) | {b"time": header[-8:]}
    return _fields_before(header)


@lru_cache(maxsize=1024)
def _fields_before(header: bytes) -> Fields:
    fields, at = {}, 0
    while at < len(header):
        end = at + 4 + U32(header, at)[0]
        name, _, value = header[at + 4 : end].partition(b"=")
        fields[name] = value
        at = end
    return fields
