"""Read a bag as a log: the values of its topics as channels, with one clock per topic."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Block, Channel, Log, Options, unique
from davinci_forces.logs.ros.storage import Bag
from davinci_forces.logs.timeline import UNIX_EPOCH

JOINTS = "sensor_msgs/msg/JointState"
STATES = ("position", "velocity", "effort")  # of a joint, in SI; the message does not state whether in rad or m
# Messages with a header and vectors: the field that holds them, their names and units.
VECTORS = {
    "geometry_msgs/msg/WrenchStamped": ("wrench", {"force": "N", "torque": "N m"}),
    "geometry_msgs/msg/TwistStamped": ("twist", {"linear": "m/s", "angular": "rad/s"}),
    "geometry_msgs/msg/PoseStamped": ("pose", {"position": "m", "orientation": ""}),
    "geometry_msgs/msg/TransformStamped": ("transform", {"translation": "m", "rotation": ""}),
}
KNOWN = (JOINTS, *VECTORS)
BLOCK_MESSAGES = 1 << 13  # messages of a block


class Unlike(ValueError):
    """A message that differs from the first of its topic; the text says how."""


class Vectors:
    """Vectors and quaternions; `columns` are their components: "force.x"."""

    names: Sequence[str] = ()  # of joints; vectors have none

    def __init__(self, kind: str, message: Any) -> None:
        self.holder, units = VECTORS[kind]
        axes = {name: tuple("xyzw" if hasattr(getattr(self._held(message), name), "w") else "xyz") for name in units}
        self.paths = tuple((name, axis) for name in units for axis in axes[name])
        self.columns = tuple(Channel(f"{name}.{axis}", units[name]) for name, axis in self.paths)

    def _held(self, message: Any) -> Any:
        return getattr(message, self.holder)

    def numbers(self, message: Any) -> Sequence[float]:
        """Return the components of one message."""
        held = self._held(message)
        return [getattr(getattr(held, name), axis) for name, axis in self.paths]


class Joints:
    """Position, velocity and effort of joints, in the order of the first message: "effort[0]", "effort[outer_yaw]"."""

    def __init__(self, first: Any) -> None:
        self.names: list[str] = list(first.name)
        self.counts = [len(getattr(first, state)) for state in STATES]
        if self.names and any(count not in (0, len(self.names)) for count in self.counts):
            raise Unlike(f"names {len(self.names)} joints but has {self._counted(self.counts)}")
        names = unique(self.names)
        self.columns = tuple(
            Channel(f"{state}[{i}]", alias=f"{state}[{names[i]}]" if self.names else "")
            for state, count in zip(STATES, self.counts, strict=True)
            for i in range(count)
        )
        self.orders: dict[tuple[str, ...], list[int] | None] = {tuple(self.names): None}

    def numbers(self, message: Any) -> Sequence[float] | None:
        """Return the states of one message in the order of the first one; None if it has none of the joints."""
        arrays = [getattr(message, state) for state in STATES]
        names = tuple(message.name)
        if names not in self.orders:
            if self.names and names and not set(self.names) & set(names):
                return None
            self.orders[names] = self._order(names)
        order = self.orders[names]
        for had, array in zip(self.counts, arrays, strict=True):
            if len(array) != (had and len(names)) and (names or len(array) != had):
                counts = self._counted([len(array) for array in arrays])
                raise Unlike(f"has {counts}, but the first message has {self._counted(self.counts)}")
        if order is None:
            return list(chain.from_iterable(arrays))
        return [array[i] for array in arrays if len(array) for i in order]

    def _order(self, names: tuple[str, ...]) -> list[int]:
        """Return the positions of the first message's joints in another message."""
        if missing := [name for name in self.names if name not in names]:
            raise Unlike(f"lacks {', '.join(missing)}, which the first message has")
        if not self.names or len(set(self.names)) < len(self.names):
            raise Unlike(f"is of {', '.join(names) or 'joints without names'}, but the first message is not")
        return [names.index(name) for name in self.names]

    def _counted(self, counts: Sequence[int]) -> str:
        return ", ".join(f"{count} of {state}" for count, state in zip(counts, STATES, strict=True))


@dataclass
class Topic:
    """The messages of one name and type."""

    name: str  # "/PSM1/measured_js"
    connections: list[Any]
    layout: Vectors | Joints
    stamped: bool  # whether headers have time stamps; else only the recorder's times exist
    first: int  # [ns] since 1970

    @property
    def stamp_channel(self) -> str:
        """The channel of the time stamps in the headers."""
        return f"{self.name}/stamp"

    @property
    def receipt_channel(self) -> str:
        """The channel of the times at which the recorder received the messages."""
        return f"{self.name}/received"

    def channels(self, alone: bool) -> list[Channel]:
        """List its clocks and values; if it is the only topic, they are on the clock of the log."""
        times = [self.stamp_channel, self.receipt_channel]
        clock = times[not self.stamped]
        time = "" if alone else clock
        clocks = [Channel(name, "s", "time", time="" if alone or name == clock else clock) for name in times]
        numbers = [
            Channel(f"{self.name}/{c.name}", c.unit, time=time, alias=c.alias and f"{self.name}/{c.alias}")
            for c in self.layout.columns
        ]
        return clocks + numbers


def open_in_child(path: Path, options: Options) -> Log:
    """Open the bag.

    Raises
    ------
    BadLog
        If none of its topics has a supported type.
    """
    bag = Bag(path)
    log = BagLog(path, "ros", (), zone="UTC", bag=bag)
    log.topics = _topics(log, bag)
    if not log.topics:
        there = ", ".join(f"{c.topic} ({_short(c.msgtype)})" for c in bag.connections[:12]) or "none"
        raise BadLog(
            f"{path}: the bag has no message of a supported type ({', '.join(map(_short, KNOWN))}); its topics are "
            f"{there}"
        )
    microseconds = min(topic.first for topic in log.topics) // 1000  # the resolution of dates
    log.origin = microseconds * 1000
    log.started = (UNIX_EPOCH + timedelta(microseconds=microseconds)).replace(tzinfo=None).isoformat()
    alone = len(log.topics) == 1
    log.channels = tuple(channel for topic in log.topics for channel in topic.channels(alone))
    if alone:
        [topic] = log.topics
        log.time = topic.stamp_channel if topic.stamped else topic.receipt_channel
    return log


def _topics(log: Log, bag: Bag) -> list[Topic]:
    """List the supported topics by name; other topics become a fact."""
    by_name: dict[tuple[str, str], list[Any]] = {}
    for connection in bag.connections:
        by_name.setdefault((f"/{connection.topic.strip('/')}", connection.msgtype), []).append(connection)
    topics: list[Topic] = []
    others: list[str] = []
    for (name, kind), connections in sorted(by_name.items(), key=lambda item: item[0]):
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
        layout = Joints(message) if kind == JOINTS else Vectors(kind, message)
    except Unlike as how:
        raise BadLog(f"{log.path}: message 0 of {name} {how}") from None
    stamped = _stamp(message) != 0
    if not stamped:
        log.warnings.append(f"the headers of {name} carry no time; its clock is when its messages were recorded")
    joints = ", ".join(layout.names)
    count = sum(connection.msgcount for connection in connections)
    log.facts[name] = f"{_short(kind)}, {count} messages" + (f", joints {joints}" if joints else "")
    return Topic(name, connections, layout, stamped, _stamp(message) or received)


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")


def _stamp(message: Any) -> int:
    """Time stamp of a message [ns] since 1970."""
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@dataclass
class BagLog(Log):
    """An opened bag.  Times count from the first message of all topics."""

    bag: Bag | None = None
    topics: list[Topic] = field(default_factory=list)
    origin: int = 0  # [ns] since 1970

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, all of one topic, as `Log.blocks` says."""
        self._restart(names, kinds=("number", "time"))
        if not names:
            return
        topic, columns = next(
            (t, c) for t in self.topics if names[0] in (c := [channel.name for channel in t.channels(True)])
        )
        where = [columns.index(name) for name in names]
        rows: list[list[float]] = []
        for row in self._rows(topic):
            rows.append(row)
            if len(rows) == BLOCK_MESSAGES:
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
                raise BadLog(f"{self.path}: message {number} of {topic.name} {how}; record these separately") from None
            if numbers is None:
                self.dropped += 1
                if self.dropped == 1:
                    others = f"message {number} of {topic.name} is of other joints ({', '.join(message.name)})"
                    self.warnings.append(f"{others}; such messages are left out: record them on a separate topic")
                continue
            yield [(_stamp(message) - self.origin) / 1e9, (received - self.origin) / 1e9, *numbers]

    def _block(self, names: Sequence[str], where: Sequence[int], rows: list[list[float]]) -> Block:
        table = np.array(rows, np.float64)
        columns = zip(names, where, strict=True)
        return self.count_nans({name: np.ascontiguousarray(table[:, column]) for name, column in columns})
