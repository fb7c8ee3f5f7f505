"""Bags as ROS writes them, of joint states and vectors, by rosbags."""

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

START = 1_700_000_000 * 10**9  # [ns] since 1970
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


def _made(store, message: Message, number: int, ros1: bool):
    types = store.types
    ns = START + round(message.t * 1e9) if message.stamped else 0
    stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    header = types["std_msgs/msg/Header"](**({"seq": number} if ros1 else {}), stamp=stamp, frame_id="base")
    if message.kind.endswith("JointState"):
        return types[message.kind](header=header, **message.fields)
    [(holder, parts)] = message.fields.items()
    inner = {"twist": "Twist", "wrench": "Wrench", "pose": "Pose", "transform": "Transform"}[holder]
    made = {}
    for name, values in parts.items():
        kind = "Quaternion" if len(values) == 4 else "Point" if name == "position" else "Vector3"
        axes = dict(zip("xyzw", map(float, values), strict=False))
        made[name] = types[f"geometry_msgs/msg/{kind}"](**axes)
    whole = {holder: types[f"geometry_msgs/msg/{inner}"](**made)}
    if holder == "transform":
        whole["child_frame_id"] = "tip"
    return types[message.kind](header=header, **whole)


def write(path: Path, messages: Iterable[Message]) -> Path:
    """A bag of ROS 1 where the name ends in .bag; else a folder, of MCAP where that ends in _mcap, else of SQLite."""
    ros1 = path.suffix == ".bag"
    store = _store(ros1)
    if ros1:
        writer = rosbag1.Writer(path)
    else:
        plugin = rosbag2.StoragePlugin.MCAP if path.name.endswith("_mcap") else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    with writer:
        connections = {}
        for number, message in enumerate(messages):
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(message.topic, message.kind, typestore=store)
            made = _made(store, message, number, ros1)
            serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
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
