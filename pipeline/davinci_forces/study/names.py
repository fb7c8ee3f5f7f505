"""Read what a channel measures from its name: its symbol, its joint and its unit; `words.toml` has the words."""

import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from davinci_forces.files import read_bytes
from davinci_forces.logs.log import Channel
from davinci_forces.maths.units import OUTSIDE, canonical, measures

WORDS = tomllib.loads(read_bytes(Path(__file__).with_name("words.toml")).decode())
SIGNAL_WORDS: dict[str, list[str]] = WORDS["signal"]
FORCE_WORDS, COMMAND_WORDS, OTHER_WORDS, ROUGH_WORDS, TIME_WORDS, TIME_QUALIFIERS, IN_DEGREES = (
    frozenset[str](WORDS[name]) for name in ("force", "command", "other", "rough", "time", "time_qualifier", "degrees")
)
SECOND = "|".join(word for words in SIGNAL_WORDS.values() for word in words if len(word) > 2)
COMPOUND = re.compile(rf"\b({'|'.join(WORDS['prefix'])})({SECOND})\b", re.IGNORECASE)
PROCESSED_WORDS = ROUGH_WORDS.union(WORDS["processed"])
PARTS = re.compile(f"([/.]){OUTSIDE}")  # not the slash of `speed (rad/s)`
WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
# Joints of the da Vinci Research Kit by its own labels, of which those of the slide are usual for any da Vinci arm.
INSERTION_WORDS = {"insertion", "ins"}
PSM_JOINTS = {"yaw": "hand_roll", "pitch": "hand_pitch", **dict.fromkeys(INSERTION_WORDS, "instrument_slide")}


@dataclass(frozen=True)
class Numbered:
    """Channels of one quantity of several joints: their names by the label of the joint, in the order of the log."""

    symbol: str
    names: dict[str, str]
    words: tuple[str, ...]


def words_of(name: str) -> list[str]:
    """The words and numbers of a name, in lower case: `measuredJointPosition`, `actual_qd_0`, `Motorwinkel`."""
    return [word.lower() for word in WORD.findall(COMPOUND.sub(r"\1 \2", name))]


def without_unit(name: str) -> str:
    """A name, or its end, without the unit that ends it: joints that turn and that slide have other ones."""
    bracket = re.search(r"\s*[\[({]([^\[\](){}]*)[\])}]\s*$", name)
    if bracket and measures(canonical(bracket[1])):
        return name[: bracket.start()]
    return "" if measures(canonical(name.strip(" _"))) else name


def stated_unit(channel: Channel) -> str:
    """The unit that the log states; the label of a joint in brackets, as in `q[0]`, is none."""
    return "" if channel.name.endswith(f"[{channel.unit}]") and not measures(canonical(channel.unit)) else channel.unit


def is_time(channel: Channel) -> bool:
    """Whether a channel is named as a time, whatever its group and its unit."""
    name = re.sub(r"[\[(].*|\s/.*", "", channel.name.strip())
    words = words_of(re.split(r"[/.]", name)[-1])
    if words == ["x", "value"]:  # LabVIEW
        return True
    words = [word for word in words if word != "s" and not measures(word)] or words
    return bool(set(words) & TIME_WORDS) and set(words) <= TIME_WORDS | TIME_QUALIFIERS


def symbol_of(words: Sequence[str]) -> str:
    """The symbol of a measured quantity of a joint; "" for commands, quantities of the tip, and anything else."""
    if "".join(words).startswith("macur"):  # of KUKA's RSI, in per cent
        return ""
    if set(words) & (COMMAND_WORDS | OTHER_WORDS) or ("d" in words and set(words) & {"q", "dq", "tau"}):
        return ""
    return next((symbol for symbol, telling in SIGNAL_WORDS.items() if set(telling) & set(words)), "")


def joint_groups(channels: Sequence[Channel]) -> list[Numbered]:
    """Group channels by all of their name but the joint's number or label; of one quantity, measured signals first."""
    groups: dict[str, dict[str, str]] = {}
    for channel in channels:
        for key, label in _labels(channel):
            groups.setdefault(key, {}).setdefault(label, channel.name)
    chosen: dict[str, dict[str, str]] = {}
    for channel in channels:
        keys = dict(_labels(channel))
        if keys and not is_time(channel):
            key = max(keys, key=lambda key: len(groups[key]))
            chosen.setdefault(key, {}).setdefault(keys[key], channel.name)
    words = {key: _words(key) for key in chosen}
    signals = [Numbered(symbol_of(words[key]), names, tuple(words[key])) for key, names in chosen.items()]
    known = [group for group in signals if group.symbol]
    return sorted(known, key=lambda group: bool(ROUGH_WORDS & {*group.words}))


def _words(key: str) -> list[str]:
    """The words of a name without the joint: those of its last part with a symbol, and commands of any part."""
    parts = [words_of(part) for part in PARTS.split(key)]
    last = next((words for words in reversed(parts) if symbol_of(words)), [])
    marking = COMMAND_WORDS | OTHER_WORDS | IN_DEGREES
    return last + [word for words in parts for word in words if word in marking]


def _labels(channel: Channel) -> Iterator[tuple[str, str]]:
    """Ways to read a joint from a name, the likelier first: what is left of the name, and the label of the joint."""
    name = channel.name
    digits = [m.span() for m in re.finditer(r"\d+", name)]
    spans = [m.span(1) for m in re.finditer(r"\[([^\]]+)\]", name)] + digits[::-1]
    parts = PARTS.split(name)
    ends = [sum(map(len, parts[: k + 1])) for k in range(len(parts))]
    spans += [
        (ends[k] - len(part), ends[k]) for k, part in enumerate(parts)
        if len(parts) > 2 and part not in ("", "/", ".") and not symbol_of(words_of(part))
    ]  # fmt: skip
    for start, end in dict.fromkeys(spans):
        yield f"{name[:start]}#{without_unit(name[end:])}", name[start:end]
    yield name, ""


def psm_joint(words: Sequence[str]) -> str:
    """The joint of the da Vinci Research Kit's patient-side arm that its own label names; "" for those of the wrist."""
    label = set(words) & PSM_JOINTS.keys()
    return PSM_JOINTS[label.pop()] if len(label) == 1 and "wrist" not in words else ""
