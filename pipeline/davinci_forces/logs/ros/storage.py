"""Read the messages of a bag of ROS 1 or 2, from any storage, as bytes with the definitions of their types."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray
from rosbags import rosbag2
from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.ros.mcap import FORMATS_OF_DEFINITIONS, Mcap
from davinci_forces.logs.ros.rosbag1 import Rosbag1
from davinci_forces.logs.ros.scan import BATCH_BYTES, BATCH_MESSAGES, MAX_SIZES, Batch, Table, decompress
from davinci_forces.maths.arrays import Integers

RULE = "=" * 80 + "\n"  # between definitions in IDL
PAGES = slice(28, 32)  # bytes of a database's header with the number of pages
PAGE = slice(16, 18)  # and with the size of a page
TABLES = ("topics", "message_definitions", "messages")
# The first message of each topic and size, in half the time of GROUP BY, which sorts all messages.
MESSAGE_SIZES = """
    CREATE TEMP TABLE sizes (topic, size, timestamp, id, count, PRIMARY KEY (topic, size)) WITHOUT ROWID;
    INSERT INTO sizes SELECT topic_id, length(data), timestamp, id, 1 FROM messages NOT INDEXED WHERE true
    ON CONFLICT DO UPDATE SET count = count + 1, timestamp = min(timestamp, excluded.timestamp),
    id = CASE WHEN excluded.timestamp < timestamp THEN excluded.id ELSE id END;
"""


class Database:
    """An SQLite storage.  Of one that is cut, the rows before the first page that is not whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Any] = []
        self.sizes: dict[int, list[list[int]]] = {}  # by topic: time and id of the first of a size, the size, count
        self.warnings: list[str] = []
        self.cut = False

    def open(self) -> None:
        """List the topics; raises BadLog if it is no bag."""
        address = f"file:{quote(self.path.as_posix(), safe='/:')}?immutable=1"  # no file appears beside it
        try:
            self.base = self._whole_rows() or sqlite3.connect(address, uri=True)
            self.connections = list(self._listed())
        except sqlite3.Error as error:
            raise BadLog(f"{self.path}: this bag cannot be read ({error}); record it again") from None
        journal = self.path.with_name(f"{self.path.name}-wal")
        if journal.is_file() and journal.stat().st_size:
            remedy = "open the bag with sqlite3 once to move them"
            self.warnings.append(f"messages in {journal.name} are not read; {remedy}")

    def _whole_rows(self) -> sqlite3.Connection | None:
        """Copy the rows of a database that lacks pages; SQLite would refuse it, or take the missing bytes for zeros."""
        with open_file(self.path) as file:
            head = file.read(100)
            page, pages = int.from_bytes(head[PAGE]), int.from_bytes(head[PAGES])
            page = page if page > 1 else 1 << 16
            there = self.path.stat().st_size // page
            if there >= pages or not head.startswith(b"SQLite"):
                return None
            content = bytearray(head + file.read(there * page - len(head)))
        content[PAGES] = there.to_bytes(4)
        damaged, whole = sqlite3.connect(":memory:"), sqlite3.connect(":memory:")
        damaged.deserialize(bytes(content))
        for name, definition in damaged.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall():
            if name in TABLES:
                whole.execute(definition)
                with suppress(sqlite3.DatabaseError):  # at the first page that is not there
                    for row in damaged.execute(f"SELECT * FROM {name} NOT INDEXED ORDER BY rowid"):
                        whole.execute(f"INSERT INTO {name} VALUES ({','.join('?' * len(row))})", row)
        self.cut = True
        [(count, span)] = whole.execute("SELECT count(*), (max(timestamp) - min(timestamp)) / 1e9 FROM messages")
        messages = f"{count} messages over {span or 0:.3f} s are whole and are read"
        self.warnings.append(f"{self.path.name} is cut: {there} of its {pages} pages are there; {messages}")
        return whole

    def _listed(self) -> Iterator[Any]:
        definitions = {}
        if self.base.execute("SELECT name FROM sqlite_master WHERE name = 'message_definitions'").fetchall():
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            definitions = {kind: (encoding, text) for kind, encoding, text in self.base.execute(query)}
        self.base.executescript(MESSAGE_SIZES)
        for number, *size in self.base.execute("SELECT topic, timestamp, id, size, count FROM sizes"):
            self.sizes.setdefault(number, []).append(size)
        query = "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
        for number, topic, kind, serialization in self.base.execute(query):
            encoding, text = definitions.get(kind, ("", ""))
            definition = MessageDefinition(FORMATS_OF_DEFINITIONS.get(encoding, MessageDefinitionFormat.NONE), text)
            count = sum(size[-1] for size in self.sizes.setdefault(number, []))
            yield Connection(number, topic, kind, definition, "", count, serialization, self)

    def batches(self, connections: Sequence[Any]) -> Iterator[Batch]:
        """Yield the messages of some connections in the order of time."""
        by_id = {connection.id: connection for connection in connections}
        query = "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({}) ORDER BY timestamp, id"
        largest = max((size[-2] for number in by_id for size in self.sizes[number]), default=1)
        cursor = self.base.execute(query.format(",".join("?" * len(by_id))), [*by_id])
        while rows := cursor.fetchmany(max(1, min(BATCH_MESSAGES, BATCH_BYTES // largest))):
            owners, times, contents = zip(*rows, strict=True)
            numbers = dict(zip(by_id, range(len(by_id)), strict=True))
            yield Batch([numbers[i] for i in owners], np.array(times, np.int64), *_joined(contents))

    def samples(self, connection: Any) -> list[tuple[int, bytes]]:
        """Time and content of the first message, and of one message of other sizes."""
        first = [number for _, number, *_ in sorted(self.sizes[connection.id])[:MAX_SIZES]]
        query = "SELECT timestamp, data FROM messages WHERE id = ?"
        return [row for number in first for row in self.base.execute(query, [number])]

    def close(self) -> None:
        """Release the file."""
        self.base.close()


class Folder(DirectoryReader):  # type: ignore[misc]  # rosbags is not there for everybody who checks types
    """A bag in a folder, with its description."""

    STORAGE_PLUGINS: ClassVar[dict[str, Any]] = {"mcap": Mcap, "sqlite3": Database}


class Bag:
    """An opened bag: its storages, one after the other."""

    def __init__(self, path: Path) -> None:
        self.warnings: list[str] = []
        self.packed = False  # whether each message is compressed
        self.storages: Sequence[Any] = self._described(path) if path.is_dir() else _opened([path])
        self.warnings += [warning for storage in self.storages for warning in storage.warnings]
        self.cut = any(storage.cut for storage in self.storages)

    def _described(self, path: Path) -> Sequence[Any]:
        if not (path / "metadata.yaml").exists():
            storages = (file for file in path.iterdir() if file.suffix in (".db3", ".mcap"))
            files = sorted(storages, key=lambda f: (len(f.name), f.name))
            self.warnings.append(f"no metadata.yaml describes {', '.join(f.name for f in files)}; all are read")
            return _opened(files)
        self.folder = Folder(path)  # which removes files that it decompressed when it is forgotten
        try:
            self.folder.open()
        except rosbag2.ReaderError as error:
            raise BadLog(f"{path}: this bag cannot be read ({error}); record it again") from None
        self.packed = self.folder.metadata.compression_mode == "message"
        stated = self.folder.metadata.message_count
        count = sum(connection.msgcount for storage in self.folder.storages for connection in storage.connections)
        if count != stated:
            self.warnings.append(f"metadata.yaml counts {stated} messages, but its files hold {count}")
        return self.folder.storages  # type: ignore[no-any-return]

    @property
    def connections(self) -> Sequence[Any]:
        """Its topics with their types; in ROS 1 one connection per publisher, in ROS 2 one per storage."""
        return [connection for storage in self.storages for connection in storage.connections]

    def batches(self, connections: Sequence[Any]) -> Iterator[tuple[Sequence[Any], Batch]]:
        """Yield the messages of some connections, each storage's in the order of time, and those of its connections."""
        for storage in self.storages:
            if mine := [connection for connection in connections if connection.owner is storage]:
                batches = storage.batches(mine)
                yield from ((mine, _unpacked(batch) if self.packed else batch) for batch in batches)

    def samples(self, connection: Any) -> list[tuple[int, bytes]]:
        """Time and content of the first message, and of one message of other sizes."""
        samples = connection.owner.samples(connection)
        return [(time, decompress(content)) for time, content in samples] if self.packed else samples


def _joined(contents: Sequence[bytes]) -> tuple[Integers, Table]:
    """Sizes of messages, and what joins those of one size."""

    def table(rows: Integers) -> NDArray[np.uint8]:
        return np.frombuffer(b"".join([contents[row] for row in rows.tolist()]), np.uint8).reshape(len(rows), -1)

    return np.array([len(content) for content in contents]), table


def _unpacked(batch: Batch) -> Batch:
    rows = np.arange(len(batch.times))[:, None]
    return Batch(batch.owners, batch.times, *_joined([decompress(batch.table(row).tobytes()) for row in rows]))


def _opened(paths: Sequence[Path]) -> Sequence[Any]:
    storages: list[Any] = []
    for path in paths:
        with open_file(path) as file:
            head = file.read(8)
        kind = Rosbag1 if head.startswith(b"#ROSBAG") else Mcap if head.startswith(b"\x89MCAP") else Database
        storages.append(kind(path))
        storages[-1].open()
    return storages


@lru_cache(maxsize=64)  # bags of one robot share definitions, and parsing them takes longer than reading a small bag
def types_of(definition: Any, kind: str, ros1: bool) -> Any:
    """The fields of a type and of those in it, as the bag defines them, else as ROS does."""
    if definition.format == MessageDefinitionFormat.NONE:
        return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST).fielddefs
    with suppress(TypesysError):
        if definition.format == MessageDefinitionFormat.MSG:
            return get_types_from_msg(definition.data, kind)
        text = definition.data
        parts = text.split(RULE)[1:] if text.startswith(f"{RULE}IDL: ") else [f"\n{text}"]
        return {name: fields for part in parts for name, fields in get_types_from_idl(part.split("\n", 1)[1]).items()}
    return {}
