"""Guess what channels hold whose names do not name a joint: by numbers in names, else by content."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from davinci_forces.logs.log import Channel, Log
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.periods.repetition import repetition
from davinci_forces.maths.signals import columns

MAX_SAMPLES = 200_000  # samples of a log that are read
MAX_CHANNELS = 400  # channels of a log whose samples are read
MIN_REPEATING_SHARE = 0.5  # share of a recording that must repeat for its motion to count as periodic
# Words for a quantity in names whose number is the joint's, the more specific first.
SIGNAL_WORDS = {
    "i": ("current", "currents", "amp", "i"),
    "dq": ("velocity", "velocities", "speed", "dq", "qd", "vel"),
    "tau": ("torque", "torques", "effort", "efforts", "tau"),
    "q": ("position", "positions", "angle", "pos", "q", "theta"),
}
COMMAND_WORDS = ("desired", "target", "setpoint", "command", "commanded", "reference", "goal", "ref", "des", "cmd")
NUMBERED = re.compile(r"(.*?)(?:\[([^\]]+)\]|_?(\d+))")
TIME_WORDS = ("time", "t", "t_s", "elapsed", "x_value", "seconds")
FREE = re.compile(r"no_?-?(weight|load|mass|contact)|unloaded|free", re.IGNORECASE)
MASS_IN_NAME = re.compile(r"weight|payload|(?<![a-z0-9])(\d+)(k?g)(?![a-z])", re.IGNORECASE)
TOUCH = re.compile(r"contact|touch|push|collision", re.IGNORECASE)
HELD_OUT = re.compile(r"valid|(?<![a-z])test(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Meaning:
    """What one channel holds: a symbol of a joint, counted from 0, and the reason for the guess."""

    symbol: str
    joint: int
    reason: str


@dataclass(frozen=True)
class Holding:
    """What the channels of a log hold, by name, and how its joints move."""

    meanings: dict[str, Meaning] = field(default_factory=dict)
    joints: int = 0
    moving: tuple[int, ...] = ()  # joints, counted from 0
    time: str = ""  # the channel of times, by its content or name
    why_time: str = ""
    rate: float = 0.0  # [Hz] from the velocities, if the log gives no rate; 0 if unknown
    repeats: bool = False
    steady: bool = False
    ranges: tuple[tuple[float, float], ...] = ()  # of the positions

    def symbols(self) -> set[str]:
        """The symbols of the joints."""
        return {meaning.symbol for meaning in self.meanings.values()}


def samples_of(log: Log, names: Sequence[str]) -> dict[str, Array]:
    """Read the first samples of these channels of one clock, without the last rows that a channel lacks.

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
        if rows >= MAX_SAMPLES:
            break
    samples = {name: np.concatenate(part) if part else np.zeros(0) for name, part in parts.items()}
    complete = np.flatnonzero(np.all([np.isfinite(values) for values in samples.values()], axis=0))
    return {name: values[: complete[-1] + 1 if len(complete) else 0] for name, values in samples.items()}


def guess(log: Log) -> Holding:
    """Guess what the channels of a log hold: by the numbers in their names where possible, else by their content.

    Raises
    ------
    BadLog
        Where the log is damaged.
    """
    numbers = [channel for channel in log.channels if channel.kind == "number" and not channel.derived]
    if not 0 < len(numbers) <= MAX_CHANNELS:
        return Holding()
    meanings = by_numbers(numbers)
    if meanings:
        return _read_motion(log, Holding(meanings, 1 + max(meaning.joint for meaning in meanings.values())))
    if any(re.search("[A-Za-z]", channel.name.replace("column", "")) for channel in numbers):
        return Holding()  # its names have a meaning that we do not know
    return _by_content(log, [channel.name for channel in numbers])


def clock_hint(log: Log) -> str:
    """Propose the times of a log without a clock: a channel, or a rate by its velocities; "" where neither is found.

    Raises
    ------
    BadLog
        Where the log is damaged.
    """
    names = [channel.name for channel in log.channels if channel.kind == "number" and not channel.derived]
    if has_clock(log) or named_time(log) or not 0 < len(names) <= MAX_CHANNELS or len(log.by_clock(names)) > 1:
        return ""
    samples = samples_of(log, names)
    first = columns.first_rising_column([samples[name] for name in names])
    if first is not None:
        return f"time = {names[first]!r}, which {_rises(samples[names[first]])}"
    rate = guess(log).rate
    return f"rate = {rate!r}, at which the velocities match the derivatives of the positions" if rate else ""


def _rises(t: Array) -> str:
    return f"increases throughout ({_rate(t):.6g} Hz if it is in seconds)"


def by_numbers(channels: Sequence[Channel]) -> dict[str, Meaning]:
    """Assign joints by the position of a channel among those of one name: `q1`, `position[2]`, `effort[outer_yaw]`."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for channel in channels:
        if not is_time(channel) and (match := NUMBERED.fullmatch(channel.name)):
            groups.setdefault(match[1], []).append((match[2] or match[3], channel.name))
    meanings: dict[str, Meaning] = {}
    for stem, members in groups.items():
        words = re.findall(r"[a-z]+", stem.rpartition("/")[2].lower() or stem.lower())
        words_of_path = re.findall(r"[a-z]+", stem.lower())
        symbol = next((s for s, telling in SIGNAL_WORDS.items() if set(telling) & set(words)), "")
        assigned = {meaning.symbol for meaning in meanings.values()}
        if symbol and symbol not in assigned and not set(COMMAND_WORDS) & set(words_of_path):
            meanings |= _numbered(symbol, members)
    symbols = {meaning.symbol for meaning in meanings.values()}
    return meanings if "q" in symbols and symbols & {"tau", "i"} else {}


def _numbered(symbol: str, members: Sequence[tuple[str, str]]) -> dict[str, Meaning]:
    """Assign channels of one name by their numbers, counted from the smallest, or by their order if they have words."""
    if not all(index.isdecimal() for index, _ in members):
        return {name: Meaning(symbol, k, f"number {k + 1} of these names") for k, (_, name) in enumerate(members)}
    least = min(int(index) for index, _ in members)
    first = least if least <= 1 else 0
    return {name: Meaning(symbol, int(index) - first, "by the number in its name") for index, name in members}


def _by_content(log: Log, names: Sequence[str]) -> Holding:
    """Assign columns without names: a time, n positions, n velocities, and n efforts or currents."""
    if len(log.by_clock(names)) > 1:
        return Holding()
    samples = samples_of(log, names)
    named = named_time(log)
    first = None if named or has_clock(log) else columns.first_rising_column([samples[name] for name in names])
    time = named or ("" if first is None else names[first])
    why = "" if named or not time else _rises(samples[time])
    signals = [name for name in names if name != time]
    rows = np.arange(len(samples[names[0]]), dtype=np.float64)
    t = samples.get(time) if time else rows * log.clock.step if log.clock else None
    blocks = columns.blocks([samples[name] for name in signals], t)
    holding = Holding(time=time, why_time=why)
    if blocks is None:
        return holding
    n, values = blocks.n, [samples[name] for name in signals]
    meanings = {s: Meaning("q", k, f"position {k + 1} of {n}, by its derivative") for k, s in enumerate(signals[:n])}
    derivative = f"derivative of the moving positions (correlation {blocks.correlation:.3f})"
    meanings |= {name: Meaning("dq", k, derivative) for k, name in enumerate(signals[n : 2 * n])}
    others = [values[start : start + n] for start in range(3 * n, len(values) - n + 1, n)]
    is_current = columns.is_current(values[2 * n : 3 * n], others, blocks.moving)
    why_effort = "CHECK: follows the velocities; " + (
        "current, as later columns are torques proportional to these columns"
        if is_current else "effort, as nothing shows that it is a current"
    )  # fmt: skip
    effort = "i" if is_current else "tau"
    meanings |= {name: Meaning(effort, k, why_effort) for k, name in enumerate(signals[2 * n : 3 * n])}
    rate = 0.0 if t is not None else columns.round_rate(blocks.rate)
    return with_motion(replace(holding, meanings=meanings, joints=n, rate=rate), samples)


def _rate(t: Array) -> float:
    return (len(t) - 1) / float(t[-1] - t[0])


def _read_motion(log: Log, holding: Holding) -> Holding:
    """Read the motion of the joints of a log, and add it to what its channels hold."""
    names = [name for name, meaning in holding.meanings.items() if meaning.symbol in ("q", "dq")]
    samples: dict[str, Array] = {}
    for channels in log.by_clock(names).values():
        samples |= samples_of(log, channels)
    return with_motion(holding, samples)


def with_motion(holding: Holding, samples: dict[str, Array]) -> Holding:
    """Add which joints move, whether the motion repeats, and whether one joint moves at constant velocities."""
    q = {m.joint: samples[name] for name, m in holding.meanings.items() if m.symbol == "q"}
    dq = {m.joint: samples[name] for name, m in holding.meanings.items() if m.symbol == "dq" and name in samples}
    if not q or not all(len(values) for values in q.values()):
        return holding
    joints = sorted(q)
    moving = tuple(joints[i] for i in columns.moving_positions([q[joint] for joint in joints]))
    again = repetition([q[joint] for joint in moving]) if moving else None
    velocity = dq.get(moving[0], np.gradient(q[moving[0]])) if len(moving) == 1 else None
    return replace(
        holding, moving=moving,
        repeats=again is not None and again.stop - again.start >= MIN_REPEATING_SHARE * len(q[joints[0]]),
        steady=velocity is not None and columns.is_steady(velocity),
        ranges=tuple((float(q[joint].min()), float(q[joint].max())) for joint in joints),
    )  # fmt: skip


def is_time(channel: Channel) -> bool:
    """Whether a channel is named as a time, whatever its group and the unit that follows its name."""
    return re.split(r"[\s\[(]", channel.name.rpartition("/")[2].strip().lower())[0] in TIME_WORDS


def has_clock(log: Log) -> bool:
    """Whether the format gives the time of every sample: by a clock, by a channel of times, or by one for each."""
    return bool(log.clock or log.time or all(channel.time for channel in log.channels if channel.kind == "number"))


def named_time(log: Log) -> str:
    """The channel of times: the format's own, else one named as a time, unless the format has a clock."""
    if log.time or has_clock(log):
        return log.time
    return next((channel.name for channel in log.channels if channel.kind == "number" and is_time(channel)), "")


class Role(NamedTuple):
    """A role, the reason for it, and lines for study.toml that propose another."""

    role: str
    reason: str
    more: tuple[str, ...] = ()


def roles_of(names: Sequence[str], guesses: Sequence[Holding]) -> list[Role]:
    """Guess the role of each log: by a word of its name, else by its motion compared with the other logs."""
    named = [_by_word(name) for name in names]
    repeating = [guess for guess, word in zip(guesses, named, strict=True) if not word and guess.repeats]
    covered = {joint for guess in repeating for joint in guess.moving}
    roles = [word or _by_motion(guess, covered) for guess, word in zip(guesses, named, strict=True)]
    if any(role.role == "identification" for role in roles) or not any(guess.moving for guess in guesses):
        return roles
    first = [bool(guess.moving) for guess in guesses].index(True)
    roles[first] = Role("identification", f"{roles[first].reason}; but there is no other log to identify from")
    return roles


def _by_word(name: str) -> Role | None:
    if match := FREE.search(name):
        return Role("validation", f'"{match[0]}" in its name: free motion for validation')
    if match := MASS_IN_NAME.search(name):
        mass = f"mass = {float(match[1]) * (1.0 if match[2].lower() == 'kg' else 1e-3):g}, " if match[1] else ""
        hint = f'# weight = {{ {mass}moves_with = "<joint>", position = [0.0, 0.0, 0.0] }}  # with role = "weight"'
        return Role("contact", f'"{match[0]}" in its name; "weight", if you know where the mass hangs', (hint,))
    if match := TOUCH.search(name):
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
        return Role("friction", "its joint moves at one constant velocity after another")
    if not covered:
        return Role("identification", "no log has a motion that repeats")
    if new := set(guess.moving) - covered:
        which = ", ".join(str(joint + 1) for joint in sorted(new))
        return Role("identification", f"it moves joint {which}, which no log with a repeating motion moves")
    return Role("validation", "its motion does not repeat, but that of another log does")
