"""Assign the channels of a log to quantities and units: by [log.channels], or by names for pushes into tissue."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from davinci_forces.errors import BadRobot
from davinci_forces.logs.log import Channel
from davinci_forces.maths.units import UNITS, canonical, measures
from davinci_forces.records.record import groups_of
from davinci_forces.robots import Joint, Kind, Robot
from davinci_forces.study import Source
from davinci_forces.toml import TomlTable, excerpt

# what the unit of each quantity measures; {position} and {effort} depend on the kind of joint
OF_A_JOINT = {
    "q": "{position}", "dq": "{position} rate", "theta_m": "angle", "dtheta_m": "angle rate",
    "tau": "{effort}", "i": "current",
}  # fmt: skip
OF_THE_LOG = {
    "time": "time", "depth": "length", "force": "force", "force_x": "force", "force_y": "force", "force_z": "force",
    "tip_x": "length", "tip_y": "length", "tip_z": "length", "push": "count",
}  # fmt: skip
TIP, FORCE = ("tip_x", "tip_y", "tip_z"), ("force_x", "force_y", "force_z")
ALTERNATIVES = ((("q", "theta_m"), "position"), (("tau", "i"), "effort"), (("dq", "dtheta_m"), ""))  # "": optional
# Words of a channel's name by quantity, the more specific first: the depth of a probe is a depth.
WORDS_BY_QUANTITY = {
    "depth": ("depth", "indentation", "displacement", "compression", "deformation"),
    "force": ("force", "load", "f"),
    "push": ("push", "probe", "poke", "press", "indent", "trial"),
}
RESULTANT_WORDS = ("norm", "magnitude", "total", "resultant", "abs")  # a force of such a name is preferred
ESTIMATED_WORDS = {"tcp", "ext", "external", "estimated", "model", "predicted", "desired", "target", "command", "ref"}
AXES = ("x", "y", "z")
TIP_WORDS = {"tip", "tool", "pos", "position", "end", "effector", "ee", "probe", "m", "mm", "um", *AXES}


def sources_of(log: TomlTable, robot: Robot | None) -> tuple[Source, ...]:
    """Read the sources of a log whose quantities are valid; `robot` is None where the study names no known one."""
    values = log.table("channels").values
    if not values:
        log.problem("[log.channels] must name the channel of each quantity", "channels")
    sources = [_source(log, robot, quantity, keys, value) for quantity, keys, value in _flat(values)]
    valid = tuple(s for s in sources if s)
    if robot and len(valid) == len(sources):
        _require_complete(log, robot, valid)
    return valid


def _require_complete(log: TomlTable, robot: Robot, sources: tuple[Source, ...]) -> None:
    """Check that joints have a position and an effort, a vector all components, and tissue a depth and a force."""
    for joint in dict.fromkeys(s.joint for s in sources if s.joint):
        has = {s.symbol for s in sources if s.joint == joint}
        for (first, second), needed in ALTERNATIVES:
            if needed and not has & {first, second}:
                log.problem(f"{joint} has no {needed}; give {joint}.{first} or {joint}.{second}")
            if {first, second} <= has:
                log.problem(f"{joint} has both {first} and {second}; leave one out")
    quantities = {s.quantity for s in sources}
    slides = any(robot.joint(s.joint).kind is Kind.PRISMATIC for s in sources if s.joint)
    for scalar, names in (("depth", TIP), ("force", FORCE)):
        missing = [name for name in names if name not in quantities]
        if missing and len(missing) < len(names):
            log.problem(f"{', '.join(names)} belong together; give {' and '.join(missing)}, too")
        if log.values.get("role") == "tissue" and not slides and not quantities & {scalar, *names}:
            either = f"{scalar}, or {', '.join(names)}, or the position of a prismatic joint"
            log.problem(f"a tissue log needs a {scalar}; give {either}")


def _source(log: TomlTable, robot: Robot | None, quantity: str, keys: tuple[str, ...], value: Any) -> Source | None:
    """Read the channel of one quantity: a name, a number, or a table with more properties."""
    needed = _unit_kind(log, robot, quantity, keys)
    if needed is None:
        return None
    values = value if isinstance(value, dict) else {"channel": value}
    table = TomlTable(values, log.file, (*log.path, *keys), f"{log.place}: channel of {quantity!r}")
    words = "a name, or a column number from 0"
    channel = table.take("channel", None, (str, int), words, lambda value: isinstance(value, str) or value >= 0)
    unit = _unit(table, needed) if "unit" in table else None
    sign = table.take("sign", 1, (int,), "1 or -1", lambda value: value in (1, -1))
    offset, scale = table.number("offset", 0.0), table.number("scale", 1.0)
    if scale == 0:
        table.problem("scale must not be 0, which would make every sample 0", "scale")
    table.close()
    return Source(quantity, channel, needed, unit, sign, offset, scale)


def _unit_kind(log: TomlTable, robot: Robot | None, quantity: str, keys: tuple[str, ...]) -> str | None:
    """What the unit of a quantity measures, or None for an unknown quantity."""
    joint, _, symbol = quantity.rpartition(".")
    if quantity in OF_THE_LOG:
        return OF_THE_LOG[quantity]
    quantities = ", ".join([*OF_THE_LOG, *(f"<joint>.{s}" for s in OF_A_JOINT)])
    problem = f"unknown quantity {quantity!r}; the quantities are {quantities}"
    if joint and symbol in OF_A_JOINT:
        try:
            return kind_of_unit(robot.joint(joint), symbol) if robot else None
        except BadRobot as error:
            problem = str(error)
    log.problem(problem, *keys)
    return None


def kind_of_unit(joint: Joint, symbol: str) -> str:
    """What the unit of a quantity of a joint measures."""
    position, effort = ("angle", "torque") if joint.kind is Kind.REVOLUTE else ("length", "force")
    return OF_A_JOINT[symbol].format(position=position, effort=measures(joint.effort) or effort)


def _unit(table: TomlTable, needed: str) -> str:
    """The listed spelling of a unit, which must measure what is needed."""
    unit = table.values["unit"]
    kind = measures(unit) if isinstance(unit, str) else None
    if unit == "":
        table.problem(f"unit is missing; it is one of {', '.join(u for u in UNITS if measures(u) == needed)}", "unit")
    elif kind is None:
        table.problem(f"unknown unit {excerpt(unit)}; known units are {', '.join(UNITS)}", "unit")
    elif kind != needed:
        table.problem(f"{unit!r} measures {kind}, but {needed} is needed", "unit")
    return canonical(str(unit))


def _flat(table: dict[str, Any]) -> Iterator[tuple[str, tuple[str, ...], Any]]:
    """List channels by quantity, with their keys; `hand_roll.q = ...` without quotes, a table, means the same."""
    for key, value in table.items():
        if isinstance(value, dict) and value and "channel" not in value and set(value) <= set(OF_A_JOINT):
            yield from ((f"{key}.{symbol}", ("channels", key, symbol), nested) for symbol, nested in value.items())
        else:
            yield key, ("channels", key), value


def words_of(channel: Channel) -> list[str]:
    """The words of a channel's name, without its group."""
    return re.findall(r"[a-z]+|\d+", channel.name.rpartition("/")[2].lower())


def tissue_channels(channels: Sequence[Channel]) -> dict[str, str]:
    """Quantities by channel name, for channels of pushes into tissue; a vector counts only if it is complete."""
    numbers = [channel for channel in channels if channel.kind == "number" and not channel.derived]
    several = groups_of((quantity, channel) for channel in numbers if (quantity := _quantity(words_of(channel))))
    for names in (TIP, FORCE):
        if not set(names) <= set(several):
            several = {quantity: named for quantity, named in several.items() if quantity not in names}
    # Of several channels of one quantity, the resultant, or the first.
    best = {key: [c for c in of if set(RESULTANT_WORDS) & set(words_of(c))] or of for key, of in several.items()}
    return {channels[0].name: quantity for quantity, channels in best.items()}


def force_sensor(quantities: Mapping[str, str]) -> dict[str, str]:
    """Of quantities by channel name, the force that a sensor beside an arm measures: no estimate, no component."""
    return {
        name: quantity for name, quantity in quantities.items()
        if quantity in ("force", *FORCE) and not ESTIMATED_WORDS & set(words := re.findall("[a-z]+", name.lower()))
        and not (quantity == "force" and (re.search(r"\d", name) or "f" in words))
    }  # fmt: skip


def is_tissue(quantities: Sequence[str]) -> bool:
    """Whether these quantities include a depth and a force."""
    return bool({"depth", *TIP} & set(quantities)) and bool({"force", *FORCE} & set(quantities))


def unit_of(channel: Channel, quantity: str) -> str:
    """The unit of a channel, by its log or by its name, as in `depth_mm`; "" where neither gives one."""
    spelled = {unit.lower(): unit for unit in UNITS if UNITS[unit][0] == OF_THE_LOG[quantity]}
    stated = canonical(channel.unit)
    if measures(stated):
        return stated
    return next((spelled[word] for word in reversed(words_of(channel)) if word in spelled), "")


def _quantity(words: list[str]) -> str:
    axis = next((axis for axis in AXES if axis in words or f"f{axis}" in words), "")
    if axis and (f"f{axis}" in words or set(WORDS_BY_QUANTITY["force"]) & set(words)):
        return f"force_{axis}"
    if axis and set(words) <= TIP_WORDS:
        return f"tip_{axis}"
    return next((quantity for quantity, telling in WORDS_BY_QUANTITY.items() if set(telling) & set(words)), "")
