"""Locate the numbers in the bytes of a message, by the definition of its type: as ROS 1 and CDR serialise."""

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from davinci_forces.logs.arrays import MAX_COLUMNS
from davinci_forces.logs.log import BadContent
from davinci_forces.maths.arrays import Array

HEADER_TYPE = "std_msgs/msg/Header"
DIMENSIONS = "std_msgs/msg/MultiArrayLayout"  # of a list, which is read as it is
JOINTS = "sensor_msgs/msg/JointState"
JOINT_LISTS = ("name", "names", "joint_names", "joints")  # fields that name the joints of other fields
PLACEHOLDER = "structure_needs_at_least_one_member"  # of an empty message, which ROS 1 does not write
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
TIME_FIELDS = np.dtype([("sec", "i4"), ("nanosec", "u4")])
ENCODINGS = (b"\0\0", b"\0\1")  # of CDR, big-endian and little-endian
NUMBER_TYPES = {
    "int8": "i1", "byte": "i1", "uint8": "u1", "char": "u1", "int16": "i2", "uint16": "u2", "int32": "i4",
    "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8", "bool": "?",
}  # fmt: skip
UNITS = {
    "geometry_msgs/msg/Wrench": {"force": "N", "torque": "N m"},
    "geometry_msgs/msg/Twist": {"linear": "m/s", "angular": "rad/s"},
    "geometry_msgs/msg/Accel": {"linear": "m/s^2", "angular": "rad/s^2"},
    "geometry_msgs/msg/Pose": {"position": "m"},
    "geometry_msgs/msg/Transform": {"translation": "m"},
    "sensor_msgs/msg/Imu": {"angular_velocity": "rad/s", "linear_acceleration": "m/s^2"},
}


@dataclass(frozen=True)
class Place:
    """Where the bytes of a message hold a number; `joint` is the one that it belongs to, or ""."""

    offset: int
    dtype: Any
    unit: str
    joint: str = ""


@dataclass
class Layout:
    """Where the numbers of a message are; messages of one size with equal `fixed` bytes share a layout."""

    joints_of: dict[str, tuple[str, ...]] = field(default_factory=dict)  # by list: the joints of its numbers
    numbers: dict[str, Place] = field(default_factory=dict)  # by field: "position[0]", "force.x"
    names: dict[str, tuple[str, ...]] = field(default_factory=dict)  # of joints, by the field that holds them all
    lengths: dict[str, int] = field(default_factory=dict)  # of lists of numbers
    stamp: Place | None = None  # the time in the header
    fixed: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))

    @property
    def wide(self) -> dict[str, int]:
        """The lengths of lists that are no channels, since they are longer than a recording has columns."""
        return {path: length for path, length in self.lengths.items() if length > MAX_COLUMNS}

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that the message itself names."""
        return self.names.get("", ())


def numbers_at(place: Place, table: NDArray[np.uint8]) -> Array:
    """The number at a place of messages, one in each row of `table`; times in seconds."""
    values = _view(place, table)
    return values["sec"] + 1e-9 * values["nanosec"] if place.dtype.names else values.astype(np.float64)


def stamps_at(place: Place, table: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Times [ns] at a place of messages, one in each row of `table`."""
    values = _view(place, table)
    return np.asarray(values["sec"].astype(np.int64) * 10**9 + values["nanosec"])


def _view(place: Place, table: NDArray[np.uint8]) -> NDArray[Any]:
    return np.asarray(table[:, place.offset : place.offset + place.dtype.itemsize].view(place.dtype)[:, 0])


def layout_of(content: bytes, kind: str, types: Any, ros1: bool, first: Layout | None = None) -> Layout:
    """Lay out a message, with joints numbered as in `first`; raises BadContent if its bytes are not of this type."""
    try:
        walk = _Walk(content, types, ros1)
        walk.message(kind, "", "", _holder(types[kind][1]))
        if not 0 <= len(content) - walk.at < (1 if ros1 else 4):  # the padding of CDR
            raise IndexError
    except KeyError as missing:
        raise BadContent(f"holds {missing.args[0]}, which the bag does not define") from None
    except (struct.error, IndexError, UnicodeDecodeError, RecursionError):
        raise BadContent(f"does not fit its definition in its {len(content)} bytes") from None
    return walk.layout(kind, first)


def _holder(fields: Sequence[Any]) -> str:
    """The only field of a message besides a header and texts, if it is a message: its name says nothing more."""
    held = [(name, node, of) for name, (node, of) in fields if of != HEADER_TYPE and not (of and of[0] == "string")]
    return held[0][0] if len(held) == 1 and held[0][1] == Nodetype.NAME and held[0][2] not in TIMES else ""


class _Walk:
    def __init__(self, content: bytes, types: Any, ros1: bool) -> None:
        if not ros1 and content[:2] not in ENCODINGS:
            raise BadContent(f"is encoded as {content[:2].hex()}, which is not plain CDR")
        self.content, self.types, self.ros1 = content, types, ros1
        self.at = self.origin = 0 if ros1 else 4
        self.order = "<" if ros1 or content[1] else ">"
        self.fixed = [range(self.origin)]
        self.lists: list[tuple[str, int | None, Place]] = []  # field, length or None, place of the first number
        self.names: dict[str, tuple[str, ...]] = {}
        self.stamp: Place | None = None

    def message(self, kind: str, path: str, unit: str, holder: str = "") -> None:
        """Pass the fields of a message; those of `holder` are named as if they were the message's."""
        fields = self.types[kind][1]
        if not fields and not self.ros1:
            self._pass(1, 1)  # CDR has no empty messages
        for name, (node, of) in fields:
            if name == PLACEHOLDER and self.ros1:
                continue
            inside = path if name == holder else f"{path}.{name}".lstrip(".")
            self._field(inside, node, of, UNITS.get(kind, {}).get(name, unit), path)

    def _field(self, path: str, node: Any, of: Any, unit: str, scope: str) -> None:
        if node == Nodetype.BASE:
            self._base(path, of[0], None, unit)
        elif of in (HEADER_TYPE, DIMENSIONS):
            with self._left_out():
                self.message(of, path, "")
                if path == "header":
                    self.stamp = self.stamp or next((p for _, _, p in self.lists if p.dtype.names), None)
        elif node == Nodetype.NAME:
            if of in TIMES:
                self._number(path, TIME_FIELDS, 4, None, "s")
            else:
                self.message(of, path, unit)
        else:
            (inner, kind), length = of
            length = length if node == Nodetype.ARRAY else self._length()
            if length > len(self.content):
                raise IndexError
            if inner == Nodetype.BASE and kind[0] == "string":
                places = [self._text() for _ in range(length)]
                if path.rpartition(".")[2] in JOINT_LISTS:
                    self.fixed += places
                    texts = (self.content[place.start : place.stop] for place in places)
                    self.names[scope] = tuple(text.decode().rstrip("\0") for text in texts)
            elif inner == Nodetype.BASE:
                self._base(path, kind[0], length, unit)
            else:
                with self._left_out():  # messages of a list may be of anything, in any order
                    for _ in range(length):
                        self._field(path, inner, kind, unit, path)

    @contextmanager
    def _left_out(self) -> Iterator[None]:
        lists, names = len(self.lists), dict(self.names)
        yield
        del self.lists[lists:]
        self.names = names

    def _base(self, path: str, kind: str, length: int | None, unit: str) -> None:
        if kind == "string":
            self._text()
        elif kind not in NUMBER_TYPES:
            raise BadContent(f"holds {path} of type {kind}, which is not supported")
        else:
            dtype = np.dtype(NUMBER_TYPES[kind])
            self._number(path, dtype, dtype.itemsize, length, unit)

    def _number(self, path: str, dtype: Any, alignment: int, length: int | None, unit: str) -> None:
        """Pass a number, or a list of numbers; CDR pads no empty list."""
        count = 1 if length is None else length
        at = self._pass(alignment, count * dtype.itemsize) if count else self.at
        if dtype != np.bool_:
            self.lists.append((path, length, Place(at, dtype.newbyteorder(self.order), unit)))

    def _pass(self, alignment: int, size: int) -> int:
        """Go on by so many bytes, and return where they begin."""
        begin = self.at + (0 if self.ros1 else (self.origin - self.at) % alignment)
        self.at = begin + size
        if self.at > len(self.content):
            raise IndexError
        return begin

    def _length(self) -> int:
        at = self._pass(4, 4)
        self.fixed.append(range(at, at + 4))
        return int(struct.unpack_from(self.order + "I", self.content, at)[0])

    def _text(self) -> range:
        size = self._length()
        at = self._pass(1, size)
        return range(at, at + size)

    def layout(self, kind: str, first: Layout | None) -> Layout:
        fixed = np.array([at for places in self.fixed for at in places], np.intp)
        layout = Layout(names=self.names, stamp=self.stamp, fixed=fixed)
        for path, length, place in self.lists:
            if length is None:
                layout.numbers[path] = place
            else:
                layout.lengths[path] = length
                self._name_list(layout, kind, first or layout, path, place)
        return layout

    def _name_list(self, layout: Layout, kind: str, first: Layout, path: str, place: Place) -> None:
        scope = max((s for s in self.names if not s or path.startswith(f"{s}.")), key=len, default=None)
        names, length = () if scope is None else self.names[scope], layout.lengths[path]
        if kind == JOINTS and names and length not in (0, len(names)):
            raise BadContent(f"names {len(names)} joints but has {length} of {path}")
        layout.joints_of[path] = joints = names if length == len(names) else ()
        if length > MAX_COLUMNS or (not joints and length != first.lengths.get(path)):
            return
        for i, number in _numbered(length, joints, first.joints_of.get(path, ())):
            at = place.offset + i * place.dtype.itemsize
            layout.numbers[f"{path}[{number}]"] = Place(at, place.dtype, place.unit, joints[i] if joints else "")


def _numbered(length: int, joints: tuple[str, ...], first: tuple[str, ...]) -> list[tuple[int, int]]:
    """Pair the positions in a list with those in the first message; without a joint of one name, there are none."""
    if joints == first:
        return [(i, i) for i in range(length)]
    unique = len(set(joints)) == len(joints) and len(set(first)) == len(first)
    return [(i, first.index(joint)) for i, joint in enumerate(joints) if unique and joint in first]
