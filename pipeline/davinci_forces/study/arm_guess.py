"""Which robot logs are of, by how many joints they have and where these go; and a robot.toml where none fits."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from davinci_forces import robots
from davinci_forces.errors import BadRobot
from davinci_forces.robots.from_toml import robot_of
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study.guessing import Holding
from davinci_forces.toml import TomlTable
from davinci_forces.toml.file import TomlFile

FILE = "robot.toml"  # that is written beside study.toml where no robot fits
DEFAULT = "davinci"
WIDTHS = (3, 6, 7)  # positions that a log of the arm may hold: what it has, its wrist's, and that of its jaw
REACH = 0.3  # [m] within which the instrument slides
TURNS = 1.6  # [rad] within which the hand turns
TERMS = ("inertia", "gravity, sine", "gravity, cosine", "viscous friction", "Coulomb friction")


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
