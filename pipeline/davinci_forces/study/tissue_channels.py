"""Which channels of a log hold pushes into tissue, by their names: depth, force, tip and the number of the push."""

import re
from collections.abc import Sequence

from davinci_forces.logs.log import Channel
from davinci_forces.maths.units import UNITS, canonical, measures
from davinci_forces.study.channels import FORCE, OF_THE_LOG, TIP

# Words of a channel's name by what it holds, the telling ones first: the depth of a probe is a depth.
WORDS = {
    "depth": ("depth", "indentation", "displacement", "compression", "deformation"),
    "force": ("force", "load", "f"),
    "push": ("push", "probe", "poke", "press", "indent", "trial"),
}
WHOLE = ("norm", "magnitude", "total", "resultant", "abs")  # of several forces, the one of such a name
AXES = ("x", "y", "z")
OF_TIP = {"tip", "tool", "pos", "position", "end", "effector", "ee", "probe", "m", "mm", "um", *AXES}


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
    if axis and (f"f{axis}" in words or set(WORDS["force"]) & set(words)):
        return f"force_{axis}"
    if axis and set(words) <= OF_TIP:
        return f"tip_{axis}"
    return next((quantity for quantity, telling in WORDS.items() if set(telling) & set(words)), "")


def _best(named: Sequence[Channel]) -> Channel:
    """Of several channels of one quantity, the one of the whole, or the first."""
    return next((channel for channel in named if set(WHOLE) & set(words_of(channel))), named[0])
