"""A bag as a log: its topics as channels, with a clock each."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Block, Channel, Log, Options
from davinci_forces.logs.ros.messages import KNOWN, Layout, Unlike, layout_of
from davinci_forces.logs.ros.storage import Bag

ROWS = 1 << 13  # messages of a block
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


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


def opened(path: Path, options: Options) -> Log:
    """Open the bag.

    Raises
    ------
    BadLog
        If none of its topics is of a type that is read.
    """
    bag = Bag(path)
    log = BagLog(path, "ros", (), zone="UTC", bag=bag)
    log.topics = _topics(log, bag)
    if not log.topics:
        there = ", ".join(f"{c.topic} ({_short(c.msgtype)})" for c in bag.connections[:12]) or "none"
        raise BadLog(
            f"{path}: the bag has no message of a type that is read ({', '.join(map(_short, KNOWN))}); its topics are "
            f"{there}"
        )
    microseconds = min(topic.first for topic in log.topics) // 1000  # as fine as dates are written
    log.origin = microseconds * 1000
    log.started = (EPOCH + timedelta(microseconds=microseconds)).replace(tzinfo=None).isoformat()
    alone = len(log.topics) == 1
    log.channels = tuple(channel for topic in log.topics for channel in topic.channels(alone))
    if alone:
        [topic] = log.topics
        log.time = topic.stamp if topic.stamped else topic.received
    return log


def _topics(log: Log, bag: Bag) -> list[Topic]:
    """The topics that are read, by name; what the bag holds besides is a fact."""
    by_name: dict[tuple[str, str], list[Any]] = {}
    for connection in bag.connections:
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
