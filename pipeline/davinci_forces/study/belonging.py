"""Guess which files hold one recording, and by the names, number and ranges of its joints, which robot was recorded."""

import math
import re
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces import robots
from davinci_forces.errors import BadRobot
from davinci_forces.logs.joined import Joined
from davinci_forces.maths.contact.unexplained import Course
from davinci_forces.maths.signals import columns
from davinci_forces.maths.units import measures
from davinci_forces.records.record import groups_of
from davinci_forces.robots.from_toml import robot_of
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study.guessing import with_motion
from davinci_forces.study.holding import Holding, Meaning
from davinci_forces.study.joint_names import JOINT_NUMBER, by_file_name, is_angle
from davinci_forces.study.names import COMMAND_WORDS, SIGNAL_WORDS, words_of
from davinci_forces.study.timing import TimeGuess, samples_of
from davinci_forces.toml import TomlFile, TomlTable

ROBOT_FILE = "robot.toml"  # written next to study.toml if no robot fits
DEFAULT_ROBOT = "davinci"
POSITION_COUNTS = (3, 6, 7)  # positions in a log of the arm: of its joints, also of the wrist, also of the jaw
MAX_SLIDE = 0.3  # [m] within which the instrument slides
MAX_TURN = 1.6  # [rad] within which the hand turns
DAVINCI_WORDS = ("davinci", "dvrk", "psm")
OTHER_ARMS = {"kuka", "lbr", "iiwa", "franka", "panda", "ur", "kinova", "mtm", "ecm"}
MAX_ANGLE_DRIVE = 6.6  # [rad] just over a turn either way; a drive that turns farther may be in degrees
HARMONICS = 12  # more than an excitation usually has: too few distort the motion, too many keep a little noise
TERMS = ("inertia", "gravity, sine", "gravity, cosine", "viscous friction", "Coulomb friction")
OTHER_SIGNALS = ("force", "forces", "wrench", "ft", "m")  # files of recordings that hold no quantity of a joint


class Arm(NamedTuple):
    """A robot, its name in a study, the reason for the choice, and the text of its file if a file must be written."""

    name: str
    robot: Robot
    reason: str
    text: str = ""


def candidates(folder: Path) -> tuple[list[Arm], list[str]]:
    """The robots described beside the logs, then the listed ones; and why each file is not taken, if none fits."""
    arms, why_not = [], []
    for file in sorted([*folder.glob("*.urdf"), *folder.glob("*.toml")]):
        if file.name in ("study.toml", "review.toml"):
            continue
        try:
            arm = Arm(file.name, robots.load(file.name, folder), "the file beside the logs")
        except BadRobot as why:
            problem = str(why).splitlines()[-1].strip().replace(f"{file}:", "line ")
            why_not.append(f"{file.name} cannot be read: {problem}")
        else:
            arms.append(arm)
            why_not.append(f"{arm.name} has {len(arm.robot.joints)}, so it is not taken, but by --robot {arm.name}")
    return [*arms, *(Arm(name, robots.load(name, folder), "") for name in robots.ROBOTS)], why_not


def with_joints_of_files(holdings: Sequence[Holding], names: Sequence[str], arms: Sequence[Arm]) -> list[Holding]:
    """Assign the joint of each log of one joint by the name of its file and folders, where no channel tells it.

    Where that does not tell it either, it is the joint that all other logs of one joint have, if they have the same.
    It is to be checked then, and if other logs tell of more than one.
    """
    numbers = [int(found[1]) for name in names for found in JOINT_NUMBER.finditer(name)]
    robots, first = [arm.robot for arm in arms], 0 if 0 in numbers else 1
    untold = [i for i, holding in enumerate(holdings) if holding.joints == 1 and not holding.has_named_joints]
    assigned = [by_file_name(h, names[i], robots, first) if i in untold else h for i, h in enumerate(holdings)]
    named = [i for i in untold if assigned[i].has_named_joints]
    joints = {(of.robot.name if of.robot else "", frozenset(of.joints_with())) for of in (assigned[i] for i in named)}
    several = any(holding.joints > 1 for holding in assigned)
    for i in (i for i in untold if i not in named):
        if len(joints) == 1:  # the words of that name tell the joint of the others, too
            taken = by_file_name(assigned[i], names[named[0]], robots, first)
            assigned[i] = taken.to_check("which joint it is: taken is that of the other logs")
        elif several:
            assigned[i] = assigned[i].to_check("which joint it is, as other logs are of more than one")
    return assigned


def arm_of(
    holdings: Sequence[Holding], folder: Path, names: Sequence[str], arms: Sequence[Arm], why_not: Sequence[str]
) -> Arm:
    """Choose the robot of logs: one whose joints the channels name, one that fits, or a new robot.toml.

    `names` are those of the folder, the files and the channels, which may name a robot; the others are `candidates`.
    """
    counted = [holding for holding in holdings if holding.joints]
    if not counted:
        described = [arm for arm in arms if arm.reason]
        return described[0] if len(described) == 1 else next(arm for arm in arms if arm.name == DEFAULT_ROBOT)
    words = {word for name in names for word in words_of(name)}
    current = any(holding.joints_with(("i",)) for holding in counted)
    of_the_kit = words & {"psm", "dvrk"} or ("yaw" in words and not current)
    for arm in arms:
        if any(holding.robot == arm.robot for holding in counted):
            if arm.name == DEFAULT_ROBOT and of_the_kit:  # the kit's joints have the same names
                arm = Arm("dvrk_psm", robots.load("dvrk_psm", folder), "")
            return arm._replace(reason=arm.reason or "by the joints in the names of channels or files")
    n = max(holding.joints for holding in counted)
    if beside := [arm for arm in arms if arm.name not in robots.ROBOTS and len(arm.robot.joints) == n]:
        return beside[0]._replace(reason=f"the file beside the logs, with {n} joints as they have, paired in order")
    said = next((word for word in DAVINCI_WORDS if word in words), "")
    may_be = any(2 in holding.moving for holding in counted) and not words & OTHER_ARMS
    name = "davinci" if current else "dvrk_psm"
    if may_be and all(_is_davinci(holding, bool(said)) for holding in counted):
        robot = robots.load(name, folder)
        count = "" if n == len(robot.joints) else f"; these are the first {len(robot.joints)} of {n}"
        by_name = f'"{said}" in the names, ' if said else ""
        efforts = "currents" if current else "efforts"
        return Arm(name, robot, f"CHECK: by {by_name}a third joint that slides, and logs of {efforts}{count}")
    if may_be and all(_is_davinci(holding, is_named=True) for holding in counted):
        kit = "a da Vinci arm" if current else "the arm of a dVRK"
        again = f"run `new` again with --robot {name}, which takes the first 3 joints"
        why = ["no name says which arm it is", *why_not, f"if it is {kit}, {again}"]
    else:
        remedy = "if it is one, delete study.toml and run `new` again with --robot and its name"
        why = [f"no shipped robot ({', '.join(robots.ROBOTS)}) is recognised", *(why_not or [remedy])]
    name = ROBOT_FILE if not (folder / ROBOT_FILE).exists() else f"robot-of-{n}.toml"
    largest = max(counted, key=lambda holding: holding.joints)
    text = robot_text(_joint_names(largest), current, _prismatic(counted), _limits(counted))
    new_robot = robot_of(TomlTable(tomllib.loads(text), TomlFile(name, {})), "robot")
    assert new_robot is not None
    joints = "joint" if n == 1 else f"{n} joints"
    return Arm(name, new_robot, f"written for the {joints} of the logs, as {'; '.join(why)}", text)


def _is_davinci(holding: Holding, is_named: bool) -> bool:
    """Whether positions fit the da Vinci arm: two joints turn by less than half a turn, and the third may slide."""
    counts = POSITION_COUNTS if is_named else POSITION_COUNTS[:1]  # more than its three joints may be of any arm
    if holding.joints not in counts or not {0, 1, 2} <= holding.ranges.keys():
        return False
    if any(m.joint == 2 and is_angle(holding.units.get(name, "")) for name, m in holding.meanings.items()):
        return False
    reach = [max(map(abs, holding.ranges[joint])) for joint in range(3)]
    return max(reach[:2]) <= MAX_TURN and reach[2] <= MAX_SLIDE


def _joint_names(holding: Holding) -> list[str]:
    """Names for the joints of a new robot: their labels in the log, where these are words."""
    labels = [re.sub(r"[^a-z0-9_-]+", "_", label.lower()).strip("_-") for label in holding.labels]
    usable = len(set(labels)) == holding.joints and all(re.match("[a-z]", label) for label in labels)
    return labels if usable else [f"joint_{k + 1}" for k in range(holding.joints)]


def _prismatic(holdings: Sequence[Holding]) -> set[int]:
    return {
        meaning.joint
        for holding in holdings
        for name, meaning in holding.meanings.items()
        if meaning.symbol in ("q", "dq", "tau")
        and str(measures(holding.units.get(name) or meaning.unit)).startswith(("length", "force"))
    }


def _limits(holdings: Sequence[Holding]) -> dict[int, str]:
    """The ranges of the joints that move, rounded outwards in TOML; none of angles of motors or perhaps in degrees."""
    courses: dict[int, list[Course]] = {}
    for holding in holdings:
        at_motor = {meaning.joint for meaning in holding.meanings.values() if meaning.symbol == "theta_m"}
        for joint, course in holding.courses.items():
            if holding.timing.step and joint not in at_motor:
                courses.setdefault(joint, []).append(course)
    limits = {}
    for joint, parts in courses.items():
        low = _rounded(min(float(part.q.min()) for part in parts), math.floor)
        high = _rounded(max(float(part.q.max()) for part in parts), math.ceil)
        dq = _rounded(max(float(np.abs(part.dq).max()) for part in parts), math.ceil)
        if max(-low, high) <= MAX_ANGLE_DRIVE and low < high and dq:
            limits[joint] = f"{{ q = [{low:.3g}, {high:.3g}], dq = [{-dq:.3g}, {dq:.3g}] }}"
    return limits


def _rounded(value: float, towards: Callable[[float], int]) -> float:
    """A value to two digits; 0 stays 0."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 1) if value else 1.0
    return towards(value / unit) * unit


def robot_text(names: Sequence[str], current: bool, prismatic: Collection[int], limits: Mapping[int, str]) -> str:
    """Write the text of a robot of which the logs tell the joints and whether they slide."""
    lines = ['name = "robot"', f'title = "Arm of {len(names)} joint{"s" if len(names) > 1 else ""}"']
    for k, name in enumerate(names):
        kind, or_kind = (Kind.PRISMATIC, Kind.REVOLUTE)[:: 1 if k in prismatic else -1]
        lines += [
            "",
            "[[joint]]",
            f'name = "{name}"',
            f'kind = "{kind.value}"  # or "{or_kind.value}": CHECK',
            f"terms = [{', '.join(f'{chr(34)}{term}{chr(34)}' for term in TERMS)}]",
            f"harmonics = {HARMONICS}  # that the excitation has at most",
        ]
        if k in limits:
            lines.append(f"limits = {limits[k]}  # what the logs reach, for `excite`: CHECK")
        if current:
            lines += [
                'effort = "A"  # a current; if the drive is known, replace this line by these two:',
                "# torque_constant = 0.05  # [N m/A] at the motor, or [N/A]",
                "# gear_ratio = 100.0  # motor angle over joint position",
            ]
    return "\n".join(lines) + "\n"


def group_recordings(files: Sequence[Path]) -> list[list[Path]]:
    """Group files by recording, in their order; a file stays alone if no other shares the start of its name."""
    starts = ((file, *split_signal(file)) for file in files)
    groups = groups_of(((file.parent, start if signal else file.name), file) for file, start, signal in starts)
    recordings: list[list[Path]] = []
    for members in groups.values():
        symbols = {symbol_of(file.stem) for file in members}
        is_one = len(members) > 1 and "q" in symbols and symbols & {"i", "tau"}
        recordings += [members] if is_one else [[file] for file in members]
    return sorted(recordings, key=lambda members: files.index(members[0]))


def symbol_of(stem: str) -> str:
    """The symbol of the signal in a file's name, or ""; commanded signals have none."""
    words = re.findall(r"[a-z]+", split_signal(Path(stem))[1].lower())
    if not words or COMMAND_WORDS & set(words):
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
    """Guess the channels of joined files, joints in the order of columns; raises BadLog where one is damaged."""
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
    holding = with_motion(log, Holding(meanings, joints), samples, unnamed=True)
    if len(set(times)) == 1 and times[0] is not None:
        reason = "it increases throughout in every file; in seconds"
        holding = replace(holding, timing=TimeGuess(str(times[0]), reason=reason))
    return holding
