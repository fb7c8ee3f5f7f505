"""Draft a study.toml for logs, from the names, units and values of their channels."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from davinci_forces import robots
from davinci_forces.errors import BadLog, BadRequest
from davinci_forces.logs import BAG, open_log
from davinci_forces.logs.joined import Joined
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import belonging
from davinci_forces.study.channels import force_sensor, is_tissue, tissue_channels
from davinci_forces.study.entries import is_inside
from davinci_forces.study.guessing import guess
from davinci_forces.study.holding import Holding
from davinci_forces.study.log_table import DraftLog, LogTable, Row, paths_in
from davinci_forces.study.names import is_time
from davinci_forces.study.roles import Evidence, roles_of
from davinci_forces.toml import in_toml

NO_LOGS = {".toml", ".urdf", ".xacro", ".md", ".json", ".pdf", ".html", ".png", ".jpg", ".py", ".m", ".tdms_index"}


class Draft(NamedTuple):
    """The text of a study.toml, its robot, whose file may have to be written, too, a row for each log, and a remark."""

    text: str
    arm: belonging.Arm
    rows: tuple[Row, ...]
    remark: str


def is_folder(path: Path) -> bool:
    """Whether a path is a folder of logs; a ROS 2 bag is a folder, too, but one log."""
    return path.is_dir() and not any(any(path.glob(pattern)) for pattern in BAG)


def logs_in(paths: Sequence[Path]) -> list[Path]:
    """The files of folders, and of their folders, besides descriptions and documents; other paths as they are."""
    files: list[Path] = []
    for path in paths:
        if is_folder(path):
            inside = [file for file in sorted(path.iterdir()) if not file.name.startswith(".")]
            files += logs_in([file for file in inside if file.suffix.lower() not in NO_LOGS])
        else:
            files.append(path)
    return files


def describe(files: Sequence[Path], folder: Path, robot_name: str = "") -> Draft:
    """Draft a study.toml that names every channel of every log and guesses its content; "" guesses the robot, too.

    Raises BadRequest if a log or the robot's file lies outside the study's folder, or there is no log.  Raises BadRobot
    if the robot cannot be read, and BadLog with the reason for each log if none can be read.
    """
    for file in files:
        if not file.resolve().is_relative_to(folder.resolve()):
            raise BadRequest(f"{file} lies outside {folder}; copy it there first, as a study holds its own logs")
    if not files:
        raise BadRequest(f"{folder} holds no logs")
    if robot_name.endswith(robots.FILES):
        if Path(robot_name).is_file():  # named from the current folder
            with suppress(ValueError):
                robot_name = Path(robot_name).absolute().relative_to(folder.absolute()).as_posix()
        if not (is_inside(robot_name) and (folder / robot_name).exists()):
            remedy = f"copy that file into {folder}, beside study.toml, and give its name there"
            raise BadRequest(f"--robot {robot_name}: {remedy}")
    stated = [belonging.Arm(robot_name, robots.load(robot_name, folder), "")] if robot_name else []
    arms, why_not = (stated, []) if stated else belonging.candidates(folder)
    drawn: list[DraftLog] = []
    refused: dict[Path, str] = {}
    for members in belonging.group_recordings(files):
        try:
            drawn.append(_draft_log(members, [arm.robot for arm in arms]))
        except (BadLog, OSError) as why:
            refused[members[0]] = str(why)
    if not drawn:
        what = "no log can be read, so no study is written; do what each line says, or name other files"
        raise BadLog("\n".join([*refused.values(), what]))
    drawn = _same_currents(drawn)
    paths = paths_in([draft.files[0] for draft in drawn], folder)
    guesses = belonging.with_joints_of_files([draft.guess for draft in drawn], paths, arms)
    drawn = [replace(draft, guess=holding) for draft, holding in zip(drawn, guesses, strict=True)]
    channels = [channel.alias or channel.name for draft in drawn for channel in draft.log.channels]
    names = [folder.resolve().name, *(file.name for file in files), *channels]
    arm = stated[0] if stated else belonging.arm_of([draft.guess for draft in drawn], folder, names, arms, why_not)
    drawn = _named_as(arm, drawn)
    named = [*_distinct(drawn)]
    roles = roles_of([_evidence(draft, name, folder, arm.robot) for draft, name in named])
    blocks, rows = [], []
    for (draft, name), role in zip(named, roles, strict=True):
        tare = "" if role.tare is None else named[role.tare][1]
        writer = LogTable(draft, name, folder, arm.robot, role, tare)
        blocks += writer.lines()
        rows.append(writer.row())
    for file, reason in refused.items():
        [path] = paths_in([file], folder)
        blocks += ["", f"# {path}: left out: {reason}"]
        rows.append(Row(path, "-", "-", "-", f"left out: {reason}"))
    text = "\n".join([*_head(arm, folder, drawn), *blocks]) + "\n"
    by_current = [] if arm.name.endswith(".urdf") else _joints_by_current(arm.robot, drawn)  # a URDF states no drives
    assumed = [joint.name for joint in by_current if not joint.effort]
    where = f"study.toml lists those of {arm.name}, commented out, under [robot_overrides]"
    remark = f"check gear_ratio and torque_constant of {', '.join(assumed)}: {where}" if assumed else ""
    return Draft(text, arm, tuple(rows), remark)


def _draft_log(files: list[Path], listed: Sequence[Robot]) -> DraftLog:
    if len(files) > 1:
        joined = Joined([open_log(file) for file in files])
        return DraftLog(files, joined, belonging.guess_joined(joined), {})
    log = open_log(files[0])
    holding = guess(log, listed)
    touching = tissue_channels([channel for channel in log.channels if not is_time(channel)])
    by_values = all(meaning.reason.startswith("CHECK") for meaning in holding.meanings.values())
    if holding.meanings and by_values and is_tissue([*touching.values()]):  # names tell more than values
        holding = Holding(timing=holding.timing)
    touching = {name: quantity for name, quantity in touching.items() if name not in holding.meanings}
    if holding.meanings:
        return DraftLog(files, log, holding, {}, force_sensor(touching))
    return DraftLog(files, log, holding, touching if is_tissue([*touching.values()]) else {})


def _evidence(draft: DraftLog, name: str, folder: Path, robot: Robot) -> Evidence:
    path = draft.files[0].resolve().relative_to(folder.resolve())
    moving = [robot.joints[k].kind for k in draft.guess.moving if k < len(robot.joints)]
    text = (path.parent / draft.files[0].name.partition(".")[0]).as_posix()
    return Evidence(name, text, draft.guess, bool(draft.touching), Kind.PRISMATIC in moving)


def _distinct(drawn: Sequence[DraftLog]) -> Iterator[tuple[DraftLog, str]]:
    """Each log with a name of its own: logs of one name get their folder's, or a number."""
    used: set[str] = set()
    for draft in drawn:
        name, number = draft.name, 1
        if name in used:
            name = f"{re.sub(r'[^a-z0-9_-]+', '-', draft.files[0].parent.name.lower()).strip('-_')}-{name}".strip("-")
        while name in used:
            number += 1
            name = f"{draft.name}-{number}"
        used.add(name)
        yield draft, name


def _named_as(arm: belonging.Arm, drawn: Sequence[DraftLog]) -> list[DraftLog]:
    """Assign channels to the robot's joints of the same names as their labels, else in the order of the log."""
    joints = {joint.name: k for k, joint in enumerate(arm.robot.joints)}

    def holding_of(guess: Holding) -> Holding:
        if guess.labels and set(guess.labels) <= joints.keys():
            return guess.with_joints([joints[label] for label in guess.labels])
        return guess.to_check("which joint it is: taken in order") if any(guess.labels) and not arm.text else guess

    return [replace(draft, guess=holding_of(draft.guess)) for draft in drawn]


def _head(arm: belonging.Arm, folder: Path, drawn: Sequence[DraftLog]) -> Iterator[str]:
    robot = arm.robot
    reason = f"; {arm.reason}" if arm.reason else ""
    yield f"title = {in_toml(folder.resolve().name)}"
    yield f"robot = {in_toml(arm.name)}  # {robot.title}: joints {', '.join(j.name for j in robot.joints)}{reason}"
    yield "simulated = false"
    if robot.tool:
        why = "of the tool's shaft, taken unless stated: CHECK, forces at the tip depend on it"
        yield f"# tool = {{ length = {robot.tool.length} }}  # [m] {why}"
    yield ""
    yield "[settings]  # every key has a default; the report lists the values used"
    yield f"# effort = {{ {robot.joints[0].name} = 0.5 }}  # [N m or N] to detect; verdicts then follow from it"
    yield "# harmonics = 0  # to keep in the position of a periodic motion; 0 keeps those that it has"
    yield "# delay = 0.1  # [s] by which the filter may show a push late; a longer delay lowers its noise"
    yield "# lowpass = 17.0  # [Hz] zero-phase low-pass of differentiated velocities and accelerations"
    for joint in _joints_by_current(robot, drawn):
        if arm.name.endswith(".urdf"):
            yield from ("", f"[robot_overrides.{joint.name}]")
            yield 'effort = "A"  # a current; if the drive is known, write torque_constant and gear_ratio in its place'
        elif not joint.effort:
            yield ""
            yield f"[robot_overrides.{joint.name}]  # its current becomes an effort by these; CHECK your drive"
            ratio, at_joint = ("rad/m", "N/A") if joint.kind is Kind.PRISMATIC else ("rad/rad", "N m/A")
            yield f"# gear_ratio = {joint.gear_ratio!r}  # [{ratio}]; 1.0 if positions and constant are at the joint"
            at_joint = f"with gear_ratio = 1.0 at the joint [{at_joint}]; efforts scale with both; a mass tests them"
            yield f"# torque_constant = {joint.torque_constant!r}  # [N m/A] at the motor, or {at_joint}"


def _joints_by_current(robot: Robot, drawn: Sequence[DraftLog]) -> list[Joint]:
    by_current = {k for draft in drawn for k in draft.guess.joints_with(("i",))}
    return [joint for k, joint in enumerate(robot.joints) if k in by_current]


def _same_currents(drawn: list[DraftLog]) -> list[DraftLog]:
    """Take efforts as currents in all logs without names that have as many channels as one that holds currents."""
    widths = {len(d.log.channels) for d in drawn if d.guess.joints_with(("i",))}
    reason = "CHECK: current, as in another log of as many channels"
    for i, draft in enumerate(drawn):
        meanings = draft.guess.meanings if len(draft.log.channels) in widths else {}
        unclear = {n: m for n, m in meanings.items() if m.symbol == "tau" and m.reason.startswith("CHECK")}
        currents = {name: replace(meaning, symbol="i", reason=reason) for name, meaning in unclear.items()}
        drawn[i] = replace(draft, guess=replace(draft.guess, meanings=draft.guess.meanings | currents))
    return drawn
