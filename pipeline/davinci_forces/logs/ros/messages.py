"""What messages of ROS hold: which of their numbers are channels, in which unit, and how they come out of one."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, Protocol

from davinci_forces.logs.names import unique

JOINTS = "sensor_msgs/msg/JointState"
STATES = ("position", "velocity", "effort")  # of a joint, in SI: rad or m by the joint, which the message does not say
# Messages with a header and vectors: what holds them, and their names with their units.
VECTORS = {
    "geometry_msgs/msg/WrenchStamped": ("wrench", {"force": "N", "torque": "N m"}),
    "geometry_msgs/msg/TwistStamped": ("twist", {"linear": "m/s", "angular": "rad/s"}),
    "geometry_msgs/msg/PoseStamped": ("pose", {"position": "m", "orientation": ""}),
    "geometry_msgs/msg/TransformStamped": ("transform", {"translation": "m", "rotation": ""}),
}
KNOWN = (JOINTS, *VECTORS)


class Unlike(ValueError):
    """A message that is not like the first of its topic, with words for how."""


@dataclass(frozen=True)
class Component:
    """One number of every message."""

    name: str  # "effort[0]", "force.x"
    unit: str = ""
    alias: str = ""  # "effort[outer_yaw]"


class Layout(Protocol):
    """The numbers of the messages of one topic."""

    @property
    def columns(self) -> tuple[Component, ...]:
        """What they are."""

    def numbers(self, message: Any) -> Sequence[float] | None:
        """Those of one message; None where it is not of the same joints."""


def layout_of(kind: str, message: Any) -> Layout:
    """The layout of a topic, by its first message."""
    return Joints(message) if kind == JOINTS else Vectors(kind, message)


class Vectors:
    """Vectors and quaternions."""

    def __init__(self, kind: str, message: Any) -> None:
        self.holder, units = VECTORS[kind]
        axes = {name: tuple("xyzw" if hasattr(getattr(self._held(message), name), "w") else "xyz") for name in units}
        self.paths = tuple((name, axis) for name in units for axis in axes[name])
        self.columns = tuple(Component(f"{name}.{axis}", units[name]) for name, axis in self.paths)

    def _held(self, message: Any) -> Any:
        return getattr(message, self.holder)

    def numbers(self, message: Any) -> Sequence[float]:
        """The components of one message."""
        held = self._held(message)
        return [getattr(getattr(held, name), axis) for name, axis in self.paths]


class Joints:
    """Position, velocity and effort of joints, in the order of the first message."""

    def __init__(self, first: Any) -> None:
        self.names: list[str] = list(first.name)
        self.counts = [len(getattr(first, state)) for state in STATES]
        if self.names and any(count not in (0, len(self.names)) for count in self.counts):
            raise Unlike(f"names {len(self.names)} joints and has {self._counted(self.counts)}")
        known = unique(self.names)
        self.columns = tuple(
            Component(f"{state}[{i}]", alias=f"{state}[{known[i]}]" if self.names else "")
            for state, count in zip(STATES, self.counts, strict=True)
            for i in range(count)
        )
        self.orders: dict[tuple[str, ...], list[int] | None] = {tuple(self.names): None}

    def numbers(self, message: Any) -> Sequence[float] | None:
        """The states of one message, by name where its joints come in another order."""
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
                raise Unlike(f"has {counts}, where the first one has {self._counted(self.counts)}")
        if order is None:
            return list(chain.from_iterable(arrays))
        return [array[i] for array in arrays if len(array) for i in order]

    def _order(self, names: tuple[str, ...]) -> list[int]:
        """Where the joints of the first message are in another one."""
        if missing := [name for name in self.names if name not in names]:
            raise Unlike(f"lacks {', '.join(missing)}, which the first one has")
        if not self.names or len(set(self.names)) < len(self.names):
            raise Unlike(f"is of {', '.join(names) or 'joints without names'}, where the first one is not")
        return [names.index(name) for name in self.names]

    def _counted(self, counts: Sequence[int]) -> str:
        return ", ".join(f"{count} of {state}" for count, state in zip(counts, STATES, strict=True))
