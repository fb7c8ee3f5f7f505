"""Read a bag as a log: the numbers in messages of any type as channels, with one clock per topic."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import BadContent, Block, Channel, Log, unique
from davinci_forces.logs.ros.layout import Layout, layout_of, numbers_at, stamps_at
from davinci_forces.logs.ros.scan import Batch
from davinci_forces.logs.ros.storage import Bag, types_of
from davinci_forces.logs.timeline import UNIX_EPOCH

UNSTEADY = "lists of unsteady length"  # kind of their channels
SERVICES = ("rosgraph_msgs/msg/Log", "rcl_interfaces/msg/")  # types that ROS needs itself
SHOWN_TOPICS = 12


@dataclass
class Topic:
    """The messages of one name and type."""

    name: str  # "/PSM1/measured_js"
    connections: list[Any]
    first: Layout  # of the first message, or of one with more numbers
    started: int  # [ns] since 1970
    stamped: bool  # whether headers have time stamps; else only the recorder's times exist
    unsteady: set[str]  # numbers that some messages lack

    @property
    def clock(self) -> str:
        """The channel of its times: those in the headers, or those at which the recorder received the messages."""
        return f"{self.name}/{'stamp' if self.stamped else 'received'}"

    def channels(self, alone: bool) -> list[Channel]:
        """List its clocks and numbers; if it is the only topic, they are on the clock of the log."""
        times = [f"{self.name}/{time}" for time in ("stamp", "received") if self.first.stamp or time == "received"]
        time = "" if alone else self.clock
        clocks = [Channel(name, "s", "time", time="" if name == self.clock else time) for name in times]
        joints = {path: unique(names) for path, names in self.first.joints_of.items()}
        for number, place in self.first.numbers.items():
            path, _, i = number.rstrip("]").rpartition("[")
            alias = f"{self.name}/{path}[{joints[path][int(i)]}]" if joints.get(path) else ""
            kind = UNSTEADY if number in self.unsteady else "number"
            clocks.append(Channel(f"{self.name}/{number}", place.unit, kind, time=time, alias=alias))
        return clocks

    def is_of_others(self, layout: Layout) -> bool:
        """Whether a message names joints, but none of those in the first."""
        return bool(self.first.joints and layout.joints) and not set(self.first.joints) & set(layout.joints)


def open_in_child(path: Path) -> Log:
    """Open the bag; raises BadLog if none of its topics has numbers."""
    bag = Bag(path)
    log = BagLog(path, "ros", (), zone="UTC", bag=bag, cut=bag.cut, warnings=bag.warnings)
    log.topics = _topics(log, bag)
    if not log.topics:
        raise BadLog(f"{path}: the bag has no message with numbers; its topics are {log.facts.get('left out', 'none')}")
    microseconds = min(topic.started for topic in log.topics) // 1000  # the resolution of dates
    log.origin = microseconds * 1000
    log.started = (UNIX_EPOCH + timedelta(microseconds=microseconds)).replace(tzinfo=None).isoformat()
    alone = len(log.topics) == 1
    log.channels = tuple(channel for topic in log.topics for channel in topic.channels(alone))
    log.time = log.topics[0].clock if alone else ""
    return log


def _topics(log: Log, bag: Bag) -> list[Topic]:
    """List the topics with numbers by name; other topics become a fact."""
    by_name: dict[tuple[str, str], list[Any]] = {}
    for connection in bag.connections:
        by_name.setdefault((f"/{connection.topic.strip('/')}", connection.msgtype), []).append(connection)
    topics: dict[str, Topic] = {}
    others: list[str] = []
    for (name, kind), connections in sorted(by_name.items(), key=lambda item: item[0]):
        try:
            if name in topics or kind.startswith(SERVICES):
                raise BadContent("")
            topics[name] = _topic(log, bag, name, kind, connections)
        except BadContent as why:
            others.append(f"{name} ({_short(kind)}{f': {why}' if str(why) else ''})")
    if others:
        more = [f"{len(others) - SHOWN_TOPICS} more"] if len(others) > SHOWN_TOPICS else []
        log.facts["left out"] = ", ".join([*others[:SHOWN_TOPICS], *more])
    return list(topics.values())


def _topic(log: Log, bag: Bag, name: str, kind: str, connections: list[Any]) -> Topic:
    """Describe a topic by messages of different sizes; the one with the most numbers stands for it."""
    samples = [(c, time, content) for c in connections for time, content in bag.samples(c)]
    if not samples:
        raise BadContent("no message")
    samples.sort(key=lambda sample: sample[1])
    layouts, problems = [], []
    for connection, _, content in samples:
        try:
            layouts.append((_layout(connection, content), content))
        except BadContent as problem:
            problems.append(problem)
    if not layouts:
        raise BadContent(f"a message {problems[0]}")
    earliest, content = layouts[0]
    first = max((layout for layout, _ in layouts), key=lambda layout: len(layout.numbers))
    if not first.numbers:
        raise BadContent(_wide(first) or "no numbers outside of lists of messages")
    start = int(stamps_at(earliest.stamp, np.frombuffer(content, np.uint8)[None])[0]) if earliest.stamp else 0
    topic = Topic(name, connections, first, start or samples[0][1], start != 0, set())
    for connection, _, sample in samples:
        topic.unsteady |= first.numbers.keys() - _numbers_of(topic, connection, sample)
    if first.stamp and not start:
        log.warnings.append(f"the headers of {name} carry no time; its clock is when its messages were recorded")
    parts = [_short(kind), f"{sum(connection.msgcount for connection in connections)} messages"]
    parts += ["on the recorder's clock"] if not first.stamp else []
    parts += [f"joints {', '.join(first.joints)}"] if first.joints else []
    parts += [f"without {_wide(first)}"] if first.wide else []
    log.facts[name] = ", ".join(parts)
    return topic


def _numbers_of(topic: Topic, connection: Any, content: bytes) -> set[str]:
    """The numbers of a message; all, where it is of other joints, or is refused when it is read."""
    try:
        layout = _layout(connection, content, topic.first)
    except BadContent:
        return set(topic.first.numbers)
    return set((topic.first if topic.is_of_others(layout) else layout).numbers)


def _wide(layout: Layout) -> str:
    return ", ".join(f"{path} ({length} numbers)" for path, length in layout.wide.items())


def _layout(connection: Any, content: bytes, first: Layout | None = None) -> Layout:
    if connection.ext not in ("cdr", "ros1"):
        raise BadContent(f"is encoded as {connection.ext}")
    ros1 = connection.ext == "ros1"
    return layout_of(content, connection.msgtype, types_of(connection.msgdef, connection.msgtype, ros1), ros1, first)


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")


@dataclass
class BagLog(Log):
    """An opened bag.  Times count from the first message of all topics."""

    bag: Bag = field(kw_only=True)
    topics: list[Topic] = field(default_factory=list)
    origin: int = 0  # [ns] since 1970

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        if not names:
            return
        topic = next(t for t in self.topics if any(channel.name == names[0] for channel in t.channels(True)))
        number = 0  # of the first message of a batch
        for connections, batch in self.bag.batches(topic.connections):
            yield self._block(topic, names, connections, batch, number)
            number += len(batch.times)

    def _block(
        self, topic: Topic, names: Sequence[str], connections: Sequence[Any], batch: Batch, number: int
    ) -> Block:
        """Read messages, the first of them with a number; those of one size and layout at once."""
        values, received = np.empty((len(names), len(batch.times))), f"{topic.name}/received"
        is_read = np.ones(len(batch.times), bool)
        kinds = np.array(batch.owners) + len(connections) * batch.sizes
        for kind in np.unique(kinds):
            rows = np.flatnonzero(kinds == kind)
            table = batch.table(rows)
            while len(rows):
                first = number + int(rows[0])
                try:
                    layout = _layout(connections[batch.owners[rows[0]]], table[0].tobytes(), topic.first)
                except BadContent as how:
                    raise self.bad(f"message {first} of {topic.name} {how}; record these separately") from None
                alike = (table[:, layout.fixed] == table[0, layout.fixed]).all(axis=1)
                same, part = (rows, table) if alike.all() else (rows[alike], table[alike])
                if topic.is_of_others(layout):
                    if not self.dropped:
                        others = f"message {first} of {topic.name} is of other joints ({', '.join(layout.joints)})"
                        self.warnings.append(f"{others}; such messages are left out: record them on a separate topic")
                    is_read[same] = False
                    self.dropped += len(same)
                else:
                    there = slice(None) if len(same) == len(kinds) else same
                    for column, name in zip(values, names, strict=True):
                        if name != received:
                            column[there] = self._column(topic, name, layout, part, first)
                rows, table = rows[~alike], table[~alike]
        if received in names:
            values[names.index(received)] = (batch.times - self.origin) / 1e9
        return self.count_nans(dict(zip(names, values if is_read.all() else values[:, is_read], strict=True)))

    def _column(self, topic: Topic, name: str, layout: Layout, table: Any, number: int) -> Any:
        quantity = name.removeprefix(f"{topic.name}/")
        if quantity == "stamp" and layout.stamp:
            return (stamps_at(layout.stamp, table) - self.origin) / 1e9
        if place := layout.numbers.get(quantity):
            return numbers_at(place, table)
        joint = topic.first.numbers[quantity].joint
        what = f"{quantity} ({joint})" if joint else quantity
        why = f"has no {what}, which the first message has; record these separately"
        raise self.bad(f"message {number} of {topic.name} {why}")
