"""Guess which files hold signals of one recording, and which robot was recorded.

The robot follows from the number of joints and the ranges of their positions; a robot.toml is written if none fits.
"""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from davinci_forces import robots
from davinci_forces.errors import BadRobot
from davinci_forces.logs.joined import Joined
from davinci_forces.maths.signals import columns
from davinci_forces.robots.from_toml import robot_of
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study.guessing import COMMAND_WORDS, SIGNAL_WORDS, Holding, Meaning, samples_of, with_motion
from davinci_forces.toml import TomlTable
from davinci_forces.toml.file import TomlFile

ROBOT_FILE = "robot.toml"  # written next to study.toml if no robot fits
DEFAULT_ROBOT = "davinci"
POSITION_COUNTS = (3, 6, 7)  # positions in a log of the arm: of its joints, also of the wrist, also of the jaw
MAX_SLIDE = 0.3  # [m] within which the instrument slides
MAX_TURN = 1.6  # [rad] within which the hand turns
TERMS = ("inertia", "gravity, sine", "gravity, cosine", "viscous friction", "Coulomb friction")
OTHER_SIGNALS = ("force", "forces", "wrench", "ft", "m")  # files of recordings that hold no quantity of a joint


class Arm(NamedTuple):
    """A robot, its name in a study, the reason for the choice, and the text of its file if a file must be written."""

    name: str
    robot: Robot
    reason: str
    text: str = ""


def arm_of(holdings: Sequence[Holding], folder: Path) -> Arm:
    """Choose the robot of logs: a listed robot that fits, a description next to the logs, or a new robot.toml.

    Raises
    ------
    BadRobot
        If the robot beside the logs cannot be read.
    """
    counted = [guess for guess in holdings if guess.joints]
    if not counted:
        return Arm(DEFAULT_ROBOT, robots.load(DEFAULT_ROBOT, folder), "")
    n = max(guess.joints for guess in counted)
    current = any("i" in guess.symbols() for guess in counted)
    if all(_is_davinci(guess) for guess in counted):
        name = "davinci" if current else "dvrk_psm"
        robot = robots.load(name, folder)
        count = "" if n == len(robot.joints) else f"; these are the first {len(robot.joints)} of {n}"
        efforts = "currents" if current else "efforts"
        return Arm(name, robot, f"CHECK: guessed from a third joint that slides, and logs of {efforts}{count}")
    for file in sorted([*folder.glob("*.urdf"), *folder.glob("*.toml")]):
        if file.name in ("study.toml", "review.toml"):
            continue
        try:
            robot = robots.load(file.name, folder)
        except BadRobot:
            continue
        if len(robot.joints) == n:
            return Arm(file.name, robot, f"the file beside the logs, with {n} joints as they have")
    name = ROBOT_FILE if not (folder / ROBOT_FILE).exists() else f"robot-of-{n}.toml"
    text = robot_text(n, current)
    new_robot = robot_of(TomlTable(tomllib.loads(text), TomlFile(name, {})), "robot")
    assert new_robot is not None
    return Arm(name, new_robot, f"written for the {n} joints of the logs, as no listed robot fits", text)


def _is_davinci(guess: Holding) -> bool:
    """Whether positions fit the da Vinci arm: two joints turn by less than half a turn, and the third slides."""
    if guess.joints not in POSITION_COUNTS or len(guess.ranges) < 3:
        return False
    (low, high), turning = guess.ranges[2], guess.ranges[:2]
    slides = low >= -MAX_SLIDE and high <= MAX_SLIDE and high > low
    return slides and all(least >= -MAX_TURN and most <= MAX_TURN for least, most in turning)


def robot_text(n: int, current: bool) -> str:
    """Write the text of a robot of n revolute joints, of which nothing more is known."""
    lines = ['name = "robot"', f'title = "Arm of {n} joint{"s" if n > 1 else ""}"']
    for k in range(n):
        lines += [
            "",
            "[[joint]]",
            f'name = "joint_{k + 1}"',
            f'kind = "{Kind.REVOLUTE.value}"  # or "{Kind.PRISMATIC.value}": CHECK',
            f"terms = [{', '.join(f'{chr(34)}{term}{chr(34)}' for term in TERMS)}]",
        ]
        if current:
            lines.append('effort = "A"  # a current; if its constant is known, torque_constant = ... [N m/A]')
    return "\n".join(lines) + "\n"


def group_recordings(files: Sequence[Path]) -> list[list[Path]]:
    """Group files by recording, in their order; a file stays alone if no other shares the start of its name."""
    groups: dict[tuple[Path, str], list[Path]] = {}
    for file in files:
        start, signal = split_signal(file)
        groups.setdefault((file.parent, start if signal else file.name), []).append(file)
    recordings: list[list[Path]] = []
    for members in groups.values():
        symbols = {symbol_of(file.stem) for file in members}
        is_one = len(members) > 1 and "q" in symbols and symbols & {"i", "tau"}
        recordings += [members] if is_one else [[file] for file in members]
    return sorted(recordings, key=lambda members: files.index(members[0]))


def symbol_of(stem: str) -> str:
    """The symbol of the signal in a file's name, or ""; commanded signals have none."""
    words = re.findall(r"[a-z]+", split_signal(Path(stem))[1].lower())
    if not words or set(COMMAND_WORDS) & set(words):
        return ""
    return next((symbol for symbol, names in SIGNAL_WORDS.items() if words[0] in names), "")


def split_signal(file: Path) -> tuple[str, str]:
    """Split a file's name into the start that files of one recording share and the signal: `run`, `q_actual`."""
    name = file.name.partition(".")[0]
    signal_words = {*OTHER_SIGNALS, *(word for words in SIGNAL_WORDS.values() for word in words)}
    for match in re.finditer(r"[_-]+", name):
        if name[match.end() :].lower().partition("_")[0] in signal_words:
            return name[: match.start()], name[match.end() :]
    return name, ""


def guess_joined(log: Joined) -> Holding:
    """Guess the channels of joined files: joints in the order of columns, and a time that always increases.

    Raises
    ------
    BadLog
        Where a file is damaged.
    """
    meanings: dict[str, Meaning] = {}
    samples = {}
    times = []
    for stem, part in log.parts.items():
        names = [c.name for c in part.channels if c.kind == "number" and not c.derived]
        values = samples_of(part, names)
        first = columns.first_rising_column([values[name] for name in names])
        times.append(first)
        signals = [name for i, name in enumerate(names) if i != first]
        symbol = symbol_of(stem)
        if symbol and symbol not in {meaning.symbol for meaning in meanings.values()}:
            for k, name in enumerate(signals):
                meanings[f"{stem}/{name}"] = Meaning(symbol, k, f"column {k + 1} of the signal in the file's name")
                samples[f"{stem}/{name}"] = values[name]
    joints = 1 + max((meaning.joint for meaning in meanings.values()), default=-1)
    holding = Holding(meanings, joints)
    if len(set(times)) == 1 and times[0] is not None:
        holding = replace(holding, time=str(times[0]), why_time="it increases throughout in every file; in seconds")
    return with_motion(holding, samples)
