"""Bags as ROS writes them, of joint states and vectors, by rosbags."""

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START = 1_700_000_000 * 10**9  # [ns] since 1970
CHUNK = 1 << 16  # [bytes] of a chunk of ROS 1
DELAY = 2_000_000  # [ns] from a header's time to the recorder's


@dataclass(frozen=True)
class Message:
    """One message of a topic: its type, its header's time [s] from START, and its fields."""

    topic: str
    kind: str
    t: float
    fields: dict[str, Any] = field(default_factory=dict)
    stamped: bool = True


def joint_state(t, names, position=(), velocity=(), effort=(), topic="/PSM1/measured_js", stamped=True) -> Message:
    arrays = {"position": position, "velocity": velocity, "effort": effort}
    return Message(
        topic, "sensor_msgs/msg/JointState", t,
        {"name": list(names), **{name: np.array(values, float) for name, values in arrays.items()}}, stamped,
    )  # fmt: skip


def vectors(t, kind, holder, *pairs, topic) -> Message:
    """A message of two vectors: `vectors(0.0, "WrenchStamped", "wrench", ("force", (1, 2, 3)), ...)`."""
    return Message(topic, f"geometry_msgs/msg/{kind}", t, {holder: dict(pairs)})


def _store(ros1: bool):
    return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)


def _header(store, message: Message, number: int, ros1: bool):
    ns = START + round(message.t * 1e9) if message.stamped else 0
    stamp = store.types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    seq = {"seq": number} if ros1 else {}
    return store.types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id="base")


def _value(store, node, of, given):
    """A field as rosbags takes it; what is not given is zero or empty, and vectors may be tuples of their numbers."""
    if node == Nodetype.BASE:
        return given if given is not None else "" if of[0] == "string" else False if of[0] == "bool" else 0
    if node == Nodetype.NAME:
        fields = store.fielddefs[of][1]
        if not isinstance(given, dict):
            given = dict(zip((name for name, _ in fields), () if given is None else given, strict=False))
        assert given.keys() <= {name for name, _ in fields}
        return store.types[of](**{name: _value(store, *kind, given.get(name)) for name, kind in fields})
    (inner, kind), length = of
    given = given if given is not None else () if node == Nodetype.SEQUENCE else [None] * length
    if inner == Nodetype.BASE and kind[0] != "string":
        return np.array([x or 0 for x in given], kind[0])
    return [_value(store, inner, kind, each) for each in given]


def _made(store, message: Message, number: int, ros1: bool):
    fields = dict(store.fielddefs[message.kind][1])
    assert message.fields.keys() <= fields.keys()
    made = {n: _value(store, *kind, message.fields.get(n)) for n, kind in fields.items() if n != "header"}
    if "header" in fields:
        made["header"] = _header(store, message, number, ros1)
    return store.types[message.kind](**made)


def write(
    path: Path,
    messages: Iterable[Message],
    definitions: dict[str, str] = {},  # noqa: B006
    big: bool = False,
    compression: str = "",
) -> Path:
    """A bag of ROS 1 where the name ends in .bag; else a folder, of MCAP where that ends in _mcap, else of SQLite.

    `definitions` are of types that ROS does not have; `big` writes big-endian numbers.
    `compression` is bz2 or lz4 of ROS 1, storage (of MCAP), message or file of ROS 2.
    """
    ros1 = path.suffix == ".bag"
    store = _store(ros1)
    for kind, text in definitions.items():
        store.register(get_types_from_msg(text, kind))
    if ros1:
        writer = rosbag1.Writer(path)
        writer.chunk_threshold = CHUNK
        if compression:
            writer.set_compression(rosbag1.Writer.CompressionFormat[compression.upper()])
    else:
        plugin = rosbag2.StoragePlugin.MCAP if path.name.endswith("_mcap") else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        if compression:
            mode = rosbag2.CompressionMode[compression.upper()]
            writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for number, message in enumerate(messages):
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(message.topic, message.kind, typestore=store)
            made = _made(store, message, number, ros1)
            serialize = store.serialize_ros1 if ros1 else partial(store.serialize_cdr, little_endian=not big)
            writer.write(
                connections[message.topic], START + round(message.t * 1e9) + DELAY, serialize(made, message.kind)
            )
    return path


def content(name: str, messages: Iterable[Message]) -> bytes:
    """The bytes of a bag that is one file: of ROS 1, or the storage of one of ROS 2."""
    with tempfile.TemporaryDirectory() as home:
        path = write(Path(home) / name, messages)
        if path.is_dir():
            [path] = [file for file in path.iterdir() if file.suffix != ".yaml"]
        return path.read_bytes()
