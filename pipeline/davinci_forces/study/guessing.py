"""What the channels of a log hold where their names do not name a joint: by numbers in names, else by content."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from davinci_forces.logs.log import Channel, Log
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.periods.repetition import repetition
from davinci_forces.maths.signals import columns

MOST = 200_000  # samples of a log that are looked at
WIDEST = 400  # channels of a log whose samples are looked at
HALF = 0.5  # of a recording: a motion that repeats repeats for so long
# Words that tell a quantity, in names whose number tells the joint; the telling ones first.
WORDS = {
    "i": ("current", "currents", "amp", "i"),
    "dq": ("velocity", "velocities", "speed", "dq", "qd", "vel"),
    "tau": ("torque", "torques", "effort", "efforts", "tau"),
    "q": ("position", "positions", "angle", "pos", "q", "theta"),
}
SET = ("desired", "target", "setpoint", "command", "commanded", "reference", "goal", "ref", "des", "cmd")
NUMBERED = re.compile(r"(.*?)(?:\[([^\]]+)\]|_?(\d+))")
TIME = ("time", "t", "t_s", "elapsed", "x_value", "seconds")
FREE = re.compile(r"no_?-?(weight|load|mass|contact)|unloaded|free", re.IGNORECASE)
HUNG = re.compile(r"weight|payload|(?<![a-z0-9])(\d+)(k?g)(?![a-z])", re.IGNORECASE)
TOUCHED = re.compile(r"contact|touch|push|collision", re.IGNORECASE)
HELD_OUT = re.compile(r"valid|(?<![a-z])test(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Meaning:
    """What one channel holds: a symbol of a joint that is counted from 0, and how that is known."""

    symbol: str
    joint: int
    reason: str


@dataclass(frozen=True)
class Holding:
    """What the channels of a log hold, by their names; and how it moves."""

    told: dict[str, Meaning] = field(default_factory=dict)
    joints: int = 0
    moving: tuple[int, ...] = ()  # joints, counted from 0
    time: str = ""  # the channel of times, where content or a name tells it
    why_time: str = ""
    rate: float = 0.0  # [Hz] that velocities tell where nothing else does; 0 where they do not
    repeats: bool = False
    steady: bool = False
    ranges: tuple[tuple[float, float], ...] = ()  # of the positions

    def symbols(self) -> set[str]:
        """The symbols of the joints."""
        return {told.symbol for told in self.told.values()}


def samples_of(log: Log, names: Sequence[str]) -> dict[str, Array]:
    """The first samples of these channels, without the rows at the end that a channel lacks; they have one clock.

    Raises
    ------
    BadLog
        Where the log is damaged.
    """
    parts: dict[str, list[Array]] = {name: [] for name in names}
    rows = 0
    for block in log.blocks(list(names)):
        for name in names:
            parts[name].append(block[name])
        rows += len(block[names[0]])
        if rows >= MOST:
            break
    found = {name: np.concatenate(part) if part else np.zeros(0) for name, part in parts.items()}
    whole = np.flatnonzero(np.all([np.isfinite(values) for values in found.values()], axis=0))
    return {name: values[: whole[-1] + 1 if len(whole) else 0] for name, values in found.items()}


def guess(log: Log) -> Holding:
    """What the channels of a log hold: by the numbers in their names where these tell, else by their content.

    Raises
    ------
    BadLog
        Where the log is damaged.
    """
    numbers = [channel for channel in log.channels if channel.kind == "number" and not channel.derived]
    if not 0 < len(numbers) <= WIDEST:
        return Holding()
    told = by_numbers(numbers)
    if told:
        return _moved(log, Holding(told, 1 + max(each.joint for each in told.values())))
    if any(re.search("[A-Za-z]", channel.name.replace("column", "")) for channel in numbers):
        return Holding()  # its names mean something, if not to us
    return _by_content(log, [channel.name for channel in numbers])


def clock_hint(log: Log) -> str:
    """What may tell the times of a log without a clock: a channel, or a rate by its velocities; "" where nothing does.

    Raises
    ------
    BadLog
        Where the log is damaged.
    """
    names = [channel.name for channel in log.channels if channel.kind == "number" and not channel.derived]
    if has_clock(log) or named_time(log) or not 0 < len(names) <= WIDEST or len(log.by_clock(names)) > 1:
        return ""
    samples = samples_of(log, names)
    first = columns.rising([samples[name] for name in names])
    if first is not None:
        return f"time = {names[first]!r}, which {_rises(samples[names[first]])}"
    rate = guess(log).rate
    return f"rate = {rate!r}, by which the velocities are those of the positions" if rate else ""


def _rises(t: Array) -> str:
    return f"rises throughout ({_rate(t):.6g} Hz if it is in seconds)"


def by_numbers(channels: Sequence[Channel]) -> dict[str, Meaning]:
    """Joints by the position of a channel among those of one name: `q1`, `position[2]`, `effort[outer_yaw]`."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for channel in channels:
        if not is_time(channel) and (match := NUMBERED.fullmatch(channel.name)):
            groups.setdefault(match[1], []).append((match[2] or match[3], channel.name))
    told: dict[str, Meaning] = {}
    for stem, members in groups.items():
        words = re.findall(r"[a-z]+", stem.rpartition("/")[2].lower() or stem.lower())
        words_of_path = re.findall(r"[a-z]+", stem.lower())
        symbol = next((s for s, telling in WORDS.items() if set(telling) & set(words)), "")
        if not symbol or set(SET) & set(words_of_path) or symbol in {each.symbol for each in told.values()}:
            continue
        told |= _numbered(symbol, members)
    symbols = {each.symbol for each in told.values()}
    return told if "q" in symbols and symbols & {"tau", "i"} else {}


def _numbered(symbol: str, members: Sequence[tuple[str, str]]) -> dict[str, Meaning]:
    """Channels of one name by their numbers, counted from the least; by their order where these are words."""
    if not all(index.isdecimal() for index, _ in members):
        return {name: Meaning(symbol, k, f"number {k + 1} of those names") for k, (_, name) in enumerate(members)}
    least = min(int(index) for index, _ in members)
    first = least if least <= 1 else 0
    return {name: Meaning(symbol, int(index) - first, "by the number in its name") for index, name in members}


def _by_content(log: Log, names: Sequence[str]) -> Holding:
    """Columns without names: a time, n positions, n velocities, and n efforts or currents."""
    if len(log.by_clock(names)) > 1:
        return Holding()
    samples = samples_of(log, names)
    own = named_time(log)
    first = None if own or has_clock(log) else columns.rising([samples[name] for name in names])
    time = own or ("" if first is None else names[first])
    why = "" if own or not time else _rises(samples[time])
    left = [name for name in names if name != time]
    rows = np.arange(len(samples[names[0]]), dtype=np.float64)
    t = samples.get(time) if time else rows * log.clock.step if log.clock else None
    blocks = columns.blocks([samples[name] for name in left], t)
    found = Holding(time=time, why_time=why)
    if blocks is None:
        return found
    n, values = blocks.n, [samples[name] for name in left]
    told = {name: Meaning("q", k, f"position {k + 1} of {n}, by its derivative") for k, name in enumerate(left[:n])}
    derivative = f"derivative of the positions that move (correlation {blocks.correlation:.3f})"
    told |= {name: Meaning("dq", k, derivative) for k, name in enumerate(left[n : 2 * n])}
    others = [values[start : start + n] for start in range(3 * n, len(values) - n + 1, n)]
    is_current = columns.is_current(values[2 * n : 3 * n], others, blocks.moving)
    why_effort = "CHECK: follows the velocities; " + (
        "current, as torques of later columns are proportional to it or its like"
        if is_current else "effort, as nothing says that it is a current"
    )  # fmt: skip
    told |= {name: Meaning("i" if is_current else "tau", k, why_effort) for k, name in enumerate(left[2 * n : 3 * n])}
    rate = 0.0 if t is not None else columns.round_rate(blocks.rate)
    return motion(replace(found, told=told, joints=n, rate=rate), samples)


def _rate(t: Array) -> float:
    return (len(t) - 1) / float(t[-1] - t[0])


def _moved(log: Log, found: Holding) -> Holding:
    """The same with how its joints move."""
    names = [name for name, told in found.told.items() if told.symbol in ("q", "dq")]
    samples: dict[str, Array] = {}
    for together in log.by_clock(names).values():
        samples |= samples_of(log, together)
    return motion(found, samples)


def motion(found: Holding, samples: dict[str, Array]) -> Holding:
    """Which joints move, whether they repeat, and whether one is held at velocity after velocity."""
    q = {told.joint: samples[name] for name, told in found.told.items() if told.symbol == "q"}
    dq = {told.joint: samples[name] for name, told in found.told.items() if told.symbol == "dq" and name in samples}
    if not q or not all(len(values) for values in q.values()):
        return found
    joints = sorted(q)
    moving = tuple(joints[i] for i in columns.moving([q[joint] for joint in joints]))
    again = repetition([q[joint] for joint in moving]) if moving else None
    velocity = dq.get(moving[0], np.gradient(q[moving[0]])) if len(moving) == 1 else None
    return replace(
        found, moving=moving,
        repeats=again is not None and again.stop - again.start >= HALF * len(q[joints[0]]),
        steady=velocity is not None and columns.is_steady(velocity),
        ranges=tuple((float(q[joint].min()), float(q[joint].max())) for joint in joints),
    )  # fmt: skip


def is_time(channel: Channel) -> bool:
    """Whether a channel is called a time, whatever group it stands in and whatever unit follows its name."""
    return re.split(r"[\s\[(]", channel.name.rpartition("/")[2].strip().lower())[0] in TIME


def has_clock(log: Log) -> bool:
    """Whether the format says when every number was taken, by a clock, by a channel of times, or by one for each."""
    return bool(log.clock or log.time or all(channel.time for channel in log.channels if channel.kind == "number"))


def named_time(log: Log) -> str:
    """The channel that holds the time: the format's own, else one that is called so, unless the format has a clock."""
    if log.time or has_clock(log):
        return log.time
    return next((channel.name for channel in log.channels if channel.kind == "number" and is_time(channel)), "")


class Role(NamedTuple):
    """A role, why it was chosen, and lines that say what else it could be."""

    role: str
    reason: str
    more: tuple[str, ...] = ()


def roles_of(names: Sequence[str], guesses: Sequence[Holding]) -> list[Role]:
    """The role of each log: by a word of its name, else by its motion among those of the others."""
    told = [_by_word(name) for name in names]
    repeating = [guess for guess, word in zip(guesses, told, strict=True) if not word and guess.repeats]
    covered = {joint for guess in repeating for joint in guess.moving}
    found = [word or _by_motion(guess, covered) for guess, word in zip(guesses, told, strict=True)]
    if any(role.role == "identification" for role in found) or not any(guess.moving for guess in guesses):
        return found
    first = [bool(guess.moving) for guess in guesses].index(True)
    found[first] = Role("identification", f"{found[first].reason}; but there is no other log to identify from")
    return found


def _by_word(name: str) -> Role | None:
    if match := FREE.search(name):
        return Role("validation", f'"{match[0]}" in its name: free motion to judge by')
    if match := HUNG.search(name):
        mass = f"mass = {float(match[1]) * (1.0 if match[2].lower() == 'kg' else 1e-3):g}, " if match[1] else ""
        hint = f'# weight = {{ {mass}moves_with = "<joint>", position = [0.0, 0.0, 0.0] }}  # with role = "weight"'
        return Role("contact", f'"{match[0]}" in its name: "weight", where it is known what the mass hangs on', (hint,))
    if match := TOUCHED.search(name):
        return Role("contact", f'"{match[0]}" in its name')
    if match := HELD_OUT.search(name):
        return Role("validation", f'"{match[0]}" in its name')
    return None


def _by_motion(guess: Holding, covered: set[int]) -> Role:
    if guess.ranges and not guess.moving:
        return Role("contact", "no joint moves in it, so nothing can be identified from it")
    if guess.repeats:
        return Role("identification", "its motion repeats")
    if guess.steady and covered:
        return Role("friction", "its joint is held at velocity after velocity")
    if not covered:
        return Role("identification", "no log repeats")
    if new := set(guess.moving) - covered:
        which = ", ".join(str(joint + 1) for joint in sorted(new))
        return Role("identification", f"it moves joint {which}, which no log that repeats does")
    return Role("validation", "its motion does not repeat, and that of another log does")
