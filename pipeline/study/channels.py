"""Reading [log.channels]: which channel of a log holds which quantity, and in what unit."""

import re
from dataclasses import dataclass
from typing import Any

from pipeline.maths.units import UNITS, canonical, measures
from pipeline.robots import Kind, Robot
from pipeline.robots.from_toml import is_number
from pipeline.study import Source
from pipeline.study.problems import Problems

# quantity -> what its unit measures, with the joint's own kind of position and effort left open
OF_A_JOINT = {
    "q": "{position}", "dq": "{position} rate", "theta_m": "angle", "dtheta_m": "angle rate",
    "tau": "{effort}", "i": "current",
}  # fmt: skip
OF_THE_LOG = {
    "time": "time", "depth": "length", "force": "force", "force_x": "force", "force_y": "force", "force_z": "force",
    "tip_x": "length", "tip_y": "length", "tip_z": "length", "push": "count",
}  # fmt: skip
EITHER = ((("q", "theta_m"), "position"), (("tau", "i"), "effort"), (("dq", "dtheta_m"), ""))  # "": may be missing


@dataclass(frozen=True)
class Channels:
    """Reads the channels of one log; `robot` is None where the study names none that is known."""

    problems: Problems
    robot: Robot | None
    place: str  # what the log is called in a problem
    start: int  # the line it begins on

    def read(self, table: Any) -> tuple[Source, ...]:
        """The sources that are right."""
        if not isinstance(table, dict) or not table:
            problem = f"{self.place}: [log.channels] must say which channel holds which quantity"
            self.problems.add(self.start, problem)
            return ()
        sources = [self.source(quantity, value) for quantity, value in _flat(table)]
        good = tuple(s for s in sources if s)
        if self.robot and len(good) == len(sources):
            self.complete(good)
        return good

    def complete(self, sources: tuple[Source, ...]) -> None:
        """Every joint has a position and an effort, and nothing twice."""
        for joint in dict.fromkeys(s.joint for s in sources if s.joint):
            has = {s.symbol for s in sources if s.joint == joint}
            for (first, second), needed in EITHER:
                missing = f"{joint} has no {needed}; give {joint}.{first} or {joint}.{second}"
                both = f"{joint} has both {first} and {second}; leave one out"
                self.problems.check(not needed or bool(has & {first, second}), self.start, f"{self.place}: {missing}")
                self.problems.check(not {first, second} <= has, self.start, f"{self.place}: {both}")

    def source(self, quantity: str, value: Any) -> Source | None:
        """The channel of one quantity, by name or number, or in a table that says more about it."""
        line = self.problems.line(re.escape(quantity), self.start)
        needed = self.measured(quantity, line)
        if needed is None:
            return None
        table: dict[str, Any] = value if isinstance(value, dict) else {"channel": value}
        where = f"{self.place}: channel of {quantity!r}"
        self.problems.unknown(table, ("channel", "unit", "sign", "offset"), where, line)
        channel: Any = table.get("channel")
        unit, sign, offset = table.get("unit"), table.get("sign", 1), table.get("offset", 0.0)
        named = isinstance(channel, str) or (type(channel) is int and channel >= 0)
        signed = type(sign) is int and sign in (-1, 1)
        shifted = is_number(offset)
        check = self.problems.check
        check(named, line, f"{where} must be a name, or a column number from 0, not {channel!r}")
        check(signed, line, f"{where}: sign must be 1 or -1, not {sign!r}")
        check(shifted, line, f"{where}: offset must be a number, not {offset!r}")
        if unit is not None and not self.unit(unit, needed, where, line):
            return None
        if not (named and signed and shifted):
            return None
        return Source(quantity, channel, needed, canonical(unit) if unit else None, sign, float(offset))

    def measured(self, quantity: str, line: int) -> str | None:
        """What the unit of a quantity measures, or None for an unknown quantity."""
        joint, _, symbol = quantity.rpartition(".")
        if not joint and quantity in OF_THE_LOG:
            return OF_THE_LOG[quantity]
        if symbol not in OF_A_JOINT or not joint:
            known = ", ".join([*OF_THE_LOG, *(f"<joint>.{s}" for s in OF_A_JOINT)])
            self.problems.add(line, f"{self.place}: there is no quantity {quantity!r}; there are {known}")
            return None
        if self.robot is None:
            return None
        names = [j.name for j in self.robot.joints]
        if joint not in names:
            known = ", ".join(names)
            problem = f"{self.place}: robot {self.robot.name} has no joint {joint!r}; it has {known}"
            self.problems.add(line, problem)
            return None
        position, effort = ("angle", "torque") if self.robot.joint(joint).kind is Kind.REVOLUTE else ("length", "force")
        return OF_A_JOINT[symbol].format(position=position, effort=effort)

    def unit(self, unit: Any, needed: str, where: str, line: int) -> bool:
        """Whether a unit is known and measures what is needed."""
        if not isinstance(unit, str) or measures(unit) is None:
            self.problems.add(line, f"{where}: unknown unit {unit!r}; known are {', '.join(UNITS)}")
            return False
        if measures(unit) != needed:
            self.problems.add(line, f"{where}: {unit!r} measures {measures(unit)}, but {needed} is needed")
            return False
        return True


def _flat(table: dict[str, Any]) -> list[tuple[str, Any]]:
    """Channels by quantity: `hand_roll.q = ...` without quotes is a table of TOML and means the same."""
    flat: list[tuple[str, Any]] = []
    for key, value in table.items():
        nested = isinstance(value, dict) and "channel" not in value and set(value) <= set(OF_A_JOINT)
        flat += [(f"{key}.{symbol}", v) for symbol, v in value.items()] if nested and value else [(key, value)]
    return flat
