"""A bag as a log: its topics as channels with a clock each, read by rosbags."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from pipeline.errors import BadLog
from pipeline.logs.log import Block, Channel, Log, Options
from pipeline.logs.ros.messages import KNOWN, Layout, Unlike, layout_of

ROWS = 1 << 13  # messages of a block
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
STORAGES = rosbag2.Reader.STORAGE_PLUGINS
RULE = "=" * 80 + "\n"  # between definitions in IDL


@dataclass
class Topic:
    """The messages of one name and type."""

    name: str  # "/PSM1/measured_js"
    connections: list[Any]
    layout: Layout
    stamped: bool  # whether headers say when, else only the recorder does
    first: int  # [ns] since 1970

    @property
    def stamp(self) -> str:
        """The channel of the times that headers give."""
        return f"{self.name}/stamp"

    @property
    def received(self) -> str:
        """The channel of the times at which the recorder had the messages."""
        return f"{self.name}/received"

    def channels(self, alone: bool) -> list[Channel]:
        """Its clocks and its numbers; of the only topic of a bag they are by the log's own clock."""
        times = [self.stamp, self.received]
        clock = times[not self.stamped]
        of = "" if alone else clock
        clocks = [Channel(name, "s", "time", time="" if alone or name == clock else clock) for name in times]
        numbers = [
            Channel(f"{self.name}/{c.name}", c.unit, time=of, alias=c.alias and f"{self.name}/{c.alias}")
            for c in self.layout.columns
        ]
        return clocks + numbers


class Bag:
    """An opened bag, of either ROS."""

    def __init__(self, path: Path) -> None:
        head = _head(path)
        self.ros1 = head.startswith(b"#ROSBAG")
        if self.ros1:
            self.storage: Any = rosbag1.Reader(path)
        else:
            which = "dir" if path.is_dir() else ".mcap" if head.startswith(b"\x89MCAP") else ".db3"
            self.storage = STORAGES[which](path)
        self.storage.open()
        for database in path.glob("*.db3") if path.is_dir() else [path]:
            _require_pages(database)
        self.types: dict[str, Any] = {}

    def messages(self, connections: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """When the recorder had each message [ns] since 1970, and the message."""
        for connection, received, content in self.storage.messages(connections):
            store = self._types_of(connection)
            read = store.deserialize_ros1 if self.ros1 else store.deserialize_cdr
            yield received, read(content, connection.msgtype)

    def _types_of(self, connection: Any) -> Any:
        """The types of a connection: as the bag defines them, else as ROS does."""
        if connection.msgtype not in self.types:
            definition = connection.msgdef
            if definition.format == MessageDefinitionFormat.NONE:
                store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.LATEST)
            else:
                store = get_typestore(Stores.EMPTY)
                store.register(_defined(definition, connection.msgtype))
            self.types[connection.msgtype] = store
        return self.types[connection.msgtype]


def _head(path: Path) -> bytes:
    if path.is_dir():
        return b""
    with path.open("rb") as file:
        return file.read(32)


def _require_pages(path: Path) -> None:
    """Refuse a database without its last pages, which SQLite takes for zeros, or for an index that it does not need.

    Raises
    ------
    ReaderError
        If it is cut.
    """
    head = _head(path)
    if head.startswith(b"SQLite"):
        page, pages = int.from_bytes(head[16:18]), int.from_bytes(head[28:32])
        if path.stat().st_size < (page if page > 1 else 1 << 16) * pages:
            raise rosbag2.ReaderError(f"{path.name} ends before its {pages} pages do")


def _defined(definition: Any, kind: str) -> dict[str, Any]:
    if definition.format == MessageDefinitionFormat.MSG:
        return dict(get_types_from_msg(definition.data, kind))
    parts = definition.data.split(RULE)[1:] if definition.data.startswith(f"{RULE}IDL: ") else [f"\n{definition.data}"]
    return {name: each for part in parts for name, each in get_types_from_idl(part.split("\n", 1)[1]).items()}


def opened(path: Path, options: Options) -> Log:
    """Open the bag.

    Raises
    ------
    BadLog
        If none of its topics is of a type that is read.
    """
    try:
        bag = Bag(path)
    except (rosbag1.ReaderError, rosbag2.ReaderError) as error:
        hint = "; run `rosbag reindex` on it" if "not indexed" in str(error) else "; record it again"
        raise BadLog(f"{path}: this bag cannot be read ({error}){hint}") from None
    log = BagLog(path, "ros", (), zone="UTC", bag=bag)
    log.topics = _topics(log, bag)
    if not log.topics:
        there = ", ".join(f"{c.topic} ({_short(c.msgtype)})" for c in bag.storage.connections[:12]) or "none"
        raise BadLog(
            f"{path}: the bag has no message of a type that is read ({', '.join(map(_short, KNOWN))}); its topics are "
            f"{there}"
        )
    log.origin = min(topic.first for topic in log.topics)
    log.started = (EPOCH + timedelta(microseconds=log.origin // 1000)).replace(tzinfo=None).isoformat()
    alone = len(log.topics) == 1
    log.channels = tuple(channel for topic in log.topics for channel in topic.channels(alone))
    if alone:
        [topic] = log.topics
        log.time = topic.stamp if topic.stamped else topic.received
    return log


def _topics(log: Log, bag: Bag) -> list[Topic]:
    """The topics that are read, by name; what the bag holds besides is a fact."""
    by_name: dict[tuple[str, str], list[Any]] = {}
    for connection in bag.storage.connections:
        by_name.setdefault((f"/{connection.topic.strip('/')}", connection.msgtype), []).append(connection)
    topics: list[Topic] = []
    others: list[str] = []
    for (name, kind), connections in sorted(by_name.items(), key=lambda each: each[0]):
        first = next(bag.messages(connections), None) if kind in KNOWN else None
        if first is None or any(topic.name == name for topic in topics):
            others.append(f"{name} ({_short(kind)})")
            continue
        topics.append(_topic(log, name, kind, connections, *first))
    if others:
        log.facts["left out"] = ", ".join(others)
    return topics


def _topic(log: Log, name: str, kind: str, connections: list[Any], received: int, message: Any) -> Topic:
    try:
        layout = layout_of(kind, message)
    except Unlike as how:
        raise BadLog(f"{log.path}: message 0 of {name} {how}") from None
    stamped = _stamp(message) != 0
    if not stamped:
        log.warnings.append(f"the headers of {name} carry no time: its clock is when the recorder had the messages")
    joints = ", ".join(getattr(layout, "names", []))
    count = sum(connection.msgcount for connection in connections)
    log.facts[name] = f"{_short(kind)}, {count} messages" + (f", joints {joints}" if joints else "")
    return Topic(name, connections, layout, stamped, _stamp(message) or received)


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")


def _stamp(message: Any) -> int:
    """When a message was made [ns] since 1970."""
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@dataclass
class BagLog(Log):
    """An opened bag.  Times count from the first of all topics."""

    bag: Bag | None = None
    topics: list[Topic] = field(default_factory=list)
    origin: int = 0  # [ns] since 1970

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, all of one topic, as `Log.blocks` says."""
        self._start_anew(names, kinds=("number", "time"))
        if not names:
            return
        topic, columns = next(
            (t, c) for t in self.topics if names[0] in (c := [each.name for each in t.channels(True)])
        )
        where = [columns.index(name) for name in names]
        rows: list[list[float]] = []
        for row in self._rows(topic):
            rows.append(row)
            if len(rows) == ROWS:
                yield self._block(names, where, rows)
                rows = []
        if rows:
            yield self._block(names, where, rows)

    def _rows(self, topic: Topic) -> Iterator[list[float]]:
        assert self.bag
        for number, (received, message) in enumerate(self.bag.messages(topic.connections)):
            try:
                numbers = topic.layout.numbers(message)
            except Unlike as how:
                raise BadLog(f"{self.path}: message {number} of {topic.name} {how}; record such joints apart") from None
            if numbers is None:
                self.dropped += 1
                if self.dropped == 1:
                    others = f"message {number} of {topic.name} is of {', '.join(message.name)}"
                    self.warnings.append(f"{others}, as may be others: such messages are left out; record them apart")
                continue
            yield [(_stamp(message) - self.origin) / 1e9, (received - self.origin) / 1e9, *numbers]

    def _block(self, names: Sequence[str], where: Sequence[int], rows: list[list[float]]) -> Block:
        table = np.array(rows, np.float64)
        block = {name: np.ascontiguousarray(table[:, column]) for name, column in zip(names, where, strict=True)}
        for name, values in block.items():
            self.nans[name] += int(np.count_nonzero(np.isnan(values)))
        return block
