"""Which channel of a log holds which quantity, and in what unit: by [log.channels]; of pushes into tissue, by names."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from davinci_forces.errors import BadRobot
from davinci_forces.logs.log import Channel
from davinci_forces.maths.units import UNITS, canonical, measures
from davinci_forces.robots import Kind, Robot
from davinci_forces.study import Source
from davinci_forces.toml import TomlTable, shown

# quantity -> what its unit measures, with the joint's own kind of position and effort left open
OF_A_JOINT = {
    "q": "{position}", "dq": "{position} rate", "theta_m": "angle", "dtheta_m": "angle rate",
    "tau": "{effort}", "i": "current",
}  # fmt: skip
OF_THE_LOG = {
    "time": "time", "depth": "length", "force": "force", "force_x": "force", "force_y": "force", "force_z": "force",
    "tip_x": "length", "tip_y": "length", "tip_z": "length", "push": "count",
}  # fmt: skip
TIP, FORCE = ("tip_x", "tip_y", "tip_z"), ("force_x", "force_y", "force_z")
EITHER = ((("q", "theta_m"), "position"), (("tau", "i"), "effort"), (("dq", "dtheta_m"), ""))  # "": may be missing
# Words of a channel's name by what it holds, the telling ones first: the depth of a probe is a depth.
TELLING = {
    "depth": ("depth", "indentation", "displacement", "compression", "deformation"),
    "force": ("force", "load", "f"),
    "push": ("push", "probe", "poke", "press", "indent", "trial"),
}
WHOLE = ("norm", "magnitude", "total", "resultant", "abs")  # of several forces, the one of such a name
AXES = ("x", "y", "z")
OF_TIP = {"tip", "tool", "pos", "position", "end", "effector", "ee", "probe", "m", "mm", "um", *AXES}


@dataclass(frozen=True)
class Channels:
    """Reads the channels of one log; `robot` is None where the study names none that is known."""

    log: TomlTable
    robot: Robot | None

    def read(self) -> tuple[Source, ...]:
        """The sources that are right enough to say what they are of."""
        values = self.log.table("channels").values
        if not values:
            self.log.problem("[log.channels] must say which channel holds which quantity", "channels")
        sources = [self.source(quantity, keys, value) for quantity, keys, value in _flat(values)]
        known = tuple(s for s in sources if s)
        if self.robot and len(known) == len(sources):
            self.complete(known)
        return known

    def complete(self, sources: tuple[Source, ...]) -> None:
        """Every joint has a position and an effort, and nothing twice."""
        for joint in dict.fromkeys(s.joint for s in sources if s.joint):
            has = {s.symbol for s in sources if s.joint == joint}
            for (first, second), needed in EITHER:
                if needed and not has & {first, second}:
                    self.log.problem(f"{joint} has no {needed}; give {joint}.{first} or {joint}.{second}")
                if {first, second} <= has:
                    self.log.problem(f"{joint} has both {first} and {second}; leave one out")
        self.complete_vectors({s.quantity for s in sources})
        if self.log.values.get("role") == "tissue":
            self.complete_tissue(sources)

    def complete_vectors(self, has: set[str]) -> None:
        """A position and a force have all their components or none."""
        for names in (TIP, FORCE):
            missing = [name for name in names if name not in has]
            if missing and len(missing) < len(names):
                self.log.problem(f"{', '.join(names)} belong together; give {' and '.join(missing)}, too")

    def complete_tissue(self, sources: tuple[Source, ...]) -> None:
        """A tissue log says how deep and how hard, by channels of its own or by a joint that slides."""
        assert self.robot is not None
        has = {s.quantity for s in sources}
        if any(self.robot.joint(s.joint).kind is Kind.PRISMATIC for s in sources if s.joint):
            return
        for what, one, all_of in (("depth", "depth", TIP), ("force", "force", FORCE)):
            if one not in has and not has & set(all_of):
                either = f"{one}, or {', '.join(all_of)}, or a joint that slides"
                self.log.problem(f"a tissue log needs a {what}; give {either}")

    def source(self, quantity: str, keys: tuple[str, ...], value: Any) -> Source | None:
        """The channel of one quantity, by name or number, or in a table that says more about it."""
        needed = self.measured(quantity, keys)
        if needed is None:
            return None
        values = value if isinstance(value, dict) else {"channel": value}
        table = TomlTable(values, self.log.file, (*self.log.path, *keys), f"{self.log.place}: channel of {quantity!r}")
        words = "a name, or a column number from 0"
        channel = table.take("channel", None, (str, int), words, lambda value: isinstance(value, str) or value >= 0)
        unit = _unit(table, needed) if "unit" in table else None
        sign = table.take("sign", 1, (int,), "1 or -1", lambda value: value in (1, -1))
        offset, scale = table.number("offset", 0.0), table.number("scale", 1.0)
        if scale == 0:
            table.problem("scale must not be 0, as nothing would be left of the channel", "scale")
        table.close()
        return Source(quantity, channel, needed, unit, sign, offset, scale)

    def measured(self, quantity: str, keys: tuple[str, ...]) -> str | None:
        """What the unit of a quantity measures, or None for an unknown quantity."""
        joint, _, symbol = quantity.rpartition(".")
        if not joint and quantity in OF_THE_LOG:
            return OF_THE_LOG[quantity]
        if symbol not in OF_A_JOINT or not joint:
            known = ", ".join([*OF_THE_LOG, *(f"<joint>.{s}" for s in OF_A_JOINT)])
            self.log.problem(f"there is no quantity {quantity!r}; there are {known}", *keys)
            return None
        if self.robot is None:
            return None
        try:
            kind, effort_in = self.robot.joint(joint).kind, self.robot.joint(joint).effort
        except BadRobot as error:
            self.log.problem(str(error), *keys)
            return None
        position, effort = ("angle", "torque") if kind is Kind.REVOLUTE else ("length", "force")
        if effort_in:
            effort = str(measures(effort_in))
        return OF_A_JOINT[symbol].format(position=position, effort=effort)


def _unit(table: TomlTable, needed: str) -> str:
    """The listed spelling of a unit, which has to measure what is needed."""
    unit = table.values["unit"]
    kind = measures(unit) if isinstance(unit, str) else None
    if kind is None:
        table.problem(f"unknown unit {shown(unit)}; known are {', '.join(UNITS)}", "unit")
    elif kind != needed:
        table.problem(f"{unit!r} measures {kind}, but {needed} is needed", "unit")
    return canonical(str(unit))


def _flat(table: dict[str, Any]) -> Iterator[tuple[str, tuple[str, ...], Any]]:
    """Channels by quantity, with their keys: `hand_roll.q = ...` without quotes is a table and means the same."""
    for key, value in table.items():
        if isinstance(value, dict) and value and "channel" not in value and set(value) <= set(OF_A_JOINT):
            yield from ((f"{key}.{symbol}", ("channels", key, symbol), nested) for symbol, nested in value.items())
        else:
            yield key, ("channels", key), value


def words_of(channel: Channel) -> list[str]:
    """The words of a channel's name, without the group that it stands in."""
    return re.findall(r"[a-z]+|\d+", channel.name.rpartition("/")[2].lower())


def tissue_channels(channels: Sequence[Channel]) -> dict[str, str]:
    """Quantity by name of the channel, of those that tell of pushes; a vector counts only where it is whole."""
    numbers = [channel for channel in channels if channel.kind == "number" and not channel.derived]
    several: dict[str, list[Channel]] = {}
    for channel in numbers:
        if quantity := _quantity(words_of(channel)):
            several.setdefault(quantity, []).append(channel)
    for names in (TIP, FORCE):
        if not set(names) <= set(several):
            several = {quantity: named for quantity, named in several.items() if quantity not in names}
    return {_best(named).name: quantity for quantity, named in several.items()}


def is_tissue(quantities: Sequence[str]) -> bool:
    """Whether these quantities say how deep and how hard."""
    return bool({"depth", *TIP} & set(quantities)) and bool({"force", *FORCE} & set(quantities))


def unit_of(channel: Channel, quantity: str) -> str:
    """The unit of a channel that its log gives none of, by its name: `depth_mm`; "" where that does not say it."""
    spelled = {unit.lower(): unit for unit in UNITS if UNITS[unit][0] == OF_THE_LOG[quantity]}
    said = canonical(channel.unit)
    if measures(said):
        return said
    return next((spelled[word] for word in reversed(words_of(channel)) if word in spelled), "")


def _quantity(words: list[str]) -> str:
    axis = next((axis for axis in AXES if axis in words or f"f{axis}" in words), "")
    if axis and (f"f{axis}" in words or set(TELLING["force"]) & set(words)):
        return f"force_{axis}"
    if axis and set(words) <= OF_TIP:
        return f"tip_{axis}"
    return next((quantity for quantity, telling in TELLING.items() if set(telling) & set(words)), "")


def _best(named: Sequence[Channel]) -> Channel:
    """Of several channels of one quantity, the one of the whole, or the first."""
    return next((channel for channel in named if set(WHOLE) & set(words_of(channel))), named[0])
