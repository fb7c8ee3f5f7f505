"""What logs are of: which files hold signals of one recording, and which robot was recorded.

The robot shows in how many joints logs have, and in where these go; a robot.toml is written where none fits.
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
from davinci_forces.study.guessing import SET, WORDS, Holding, Meaning, motion, samples_of
from davinci_forces.toml import TomlTable
from davinci_forces.toml.file import TomlFile

FILE = "robot.toml"  # that is written beside study.toml where no robot fits
DEFAULT = "davinci"
WIDTHS = (3, 6, 7)  # positions that a log of the arm may hold: what it has, its wrist's, and that of its jaw
REACH = 0.3  # [m] within which the instrument slides
TURNS = 1.6  # [rad] within which the hand turns
TERMS = ("inertia", "gravity, sine", "gravity, cosine", "viscous friction", "Coulomb friction")
OF_NO_JOINT = ("force", "forces", "wrench", "ft", "m")  # files of recordings that hold no quantity of a joint


class Arm(NamedTuple):
    """A robot, by what name a study names it, why it was taken, and the text of its file where there is none yet."""

    name: str
    robot: Robot
    reason: str
    text: str = ""


def arm_of(guesses: Sequence[Holding], folder: Path) -> Arm:
    """The robot of logs: a listed one that fits, a description beside them, or one that is written.

    Raises
    ------
    BadRobot
        If the robot beside them cannot be read.
    """
    counted = [guess for guess in guesses if guess.joints]
    if not counted:
        return Arm(DEFAULT, robots.load(DEFAULT, folder), "")
    n = max(guess.joints for guess in counted)
    current = any("i" in guess.symbols() for guess in counted)
    if all(_is_davinci(guess) for guess in counted):
        name = "davinci" if current else "dvrk_psm"
        robot = robots.load(name, folder)
        of = "" if n == len(robot.joints) else f", which are the first {len(robot.joints)} of {n}"
        return Arm(name, robot, f"CHECK: its third joint slides, and {'currents' if current else 'efforts'} fit{of}")
    for file in sorted([*folder.glob("*.urdf"), *folder.glob("*.toml")]):
        if file.name in ("study.toml", "review.toml"):
            continue
        try:
            robot = robots.load(file.name, folder)
        except BadRobot:
            continue
        if len(robot.joints) == n:
            return Arm(file.name, robot, f"beside the logs, with as many joints as they have: {n}")
    name = FILE if not (folder / FILE).exists() else f"robot-of-{n}.toml"
    text = robot_text(n, current)
    robot_made = robot_of(TomlTable(tomllib.loads(text), TomlFile(name, {})), "robot")
    assert robot_made is not None
    return Arm(name, robot_made, f"written for the {n} joints of the logs: no listed robot fits", text)


def _is_davinci(guess: Holding) -> bool:
    """Whether positions may be of the da Vinci arm: two joints that turn by less than half a turn, one that slides."""
    if guess.joints not in WIDTHS or len(guess.ranges) < 3:
        return False
    (low, high), turning = guess.ranges[2], guess.ranges[:2]
    slides = low >= -REACH and high <= REACH and high > low
    return slides and all(least >= -TURNS and most <= TURNS for least, most in turning)


def robot_text(n: int, current: bool) -> str:
    """The text of a robot of n joints that turn, of which nothing more is known."""
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
            lines.append('effort = "A"  # a current; where its constant is known, torque_constant = ... [N m/A]')
    return "\n".join(lines) + "\n"


def grouped(files: Sequence[Path]) -> list[list[Path]]:
    """The files by the recording that they are of, in their order; alone where none shares the start of its name."""
    groups: dict[tuple[Path, str], list[Path]] = {}
    for file in files:
        start, signal = split(file)
        groups.setdefault((file.parent, start if signal else file.name), []).append(file)
    together: list[list[Path]] = []
    for members in groups.values():
        symbols = {symbol_of(file.stem) for file in members}
        is_one = len(members) > 1 and "q" in symbols and symbols & {"i", "tau"}
        together += [members] if is_one else [[file] for file in members]
    return sorted(together, key=lambda members: files.index(members[0]))


def symbol_of(stem: str) -> str:
    """The symbol that the signal in a file's name tells, or ""; what was only wanted tells none."""
    words = re.findall(r"[a-z]+", split(Path(stem))[1].lower())
    return next((s for s, telling in WORDS.items() if words and words[0] in telling and not set(SET) & set(words)), "")


def split(file: Path) -> tuple[str, str]:
    """The start of a file's name, which those of one recording share, and its signal: `run`, `q_actual`."""
    name = file.name.partition(".")[0]
    known = {*OF_NO_JOINT, *(word for words in WORDS.values() for word in words)}
    for match in re.finditer(r"[_-]+", name):
        if name[match.end() :].lower().partition("_")[0] in known:
            return name[: match.start()], name[match.end() :]
    return name, ""


def guess_joined(log: Joined) -> Holding:
    """What the channels of joined files hold: joints in the order of columns, beside a time that rises throughout.

    Raises
    ------
    BadLog
        Where a file is damaged.
    """
    told: dict[str, Meaning] = {}
    samples = {}
    times = []
    for stem, part in log.parts.items():
        names = [c.name for c in part.channels if c.kind == "number" and not c.derived]
        values = samples_of(part, names)
        first = columns.rising([values[name] for name in names])
        times.append(first)
        left = [name for i, name in enumerate(names) if i != first]
        symbol = symbol_of(stem)
        if symbol and symbol not in {each.symbol for each in told.values()}:
            for k, name in enumerate(left):
                told[f"{stem}/{name}"] = Meaning(symbol, k, f"column {k + 1} of the signal that its file's name tells")
                samples[f"{stem}/{name}"] = values[name]
    joints = 1 + max((each.joint for each in told.values()), default=-1)
    found = Holding(told, joints)
    if len(set(times)) == 1 and times[0] is not None:
        found = replace(found, time=str(times[0]), why_time="a column that rises throughout in every file, in seconds")
    return motion(found, samples)
