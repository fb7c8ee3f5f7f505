"""Read `raw/<study>/study.toml`, and report all its problems at once, each with its line."""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any

from davinci_forces import robots, toml
from davinci_forces.errors import BadLog, BadRobot, BadStudy
from davinci_forces.estimators import ESTIMATORS
from davinci_forces.haptics import scenario as haptics
from davinci_forces.logs import open_log
from davinci_forces.robots import Joint, Robot, from_toml
from davinci_forces.robots.models import VARIANTS
from davinci_forces.study import HapticScenario, LogEntry, Settings, Study
from davinci_forces.study.entries import check_positive, entries_of, is_inside, lines_of_files
from davinci_forces.study.guessing import clock_hint
from davinci_forces.study.timing import has_clock
from davinci_forces.toml import TomlTable, excerpt

# Variants by the estimators that they can be chosen with: a coupled arm needs a ridge.
VARIANT_FITS = tuple(
    f"{variant}.{how}" for variant in VARIANTS for how in ("lse", "ridge", "consistent")
    if how == "ridge" or variant.startswith("independent+") or (how == "consistent" and variant != "independent")
)  # fmt: skip
CHOICES = {"fit": ("chosen", *(f"independent.{estimator}" for estimator in ESTIMATORS), *VARIANT_FITS)}
TRUTH = "truth.toml"  # the ground truth of a simulated study, where its folder has it
AT_JOINT = 5.0  # torque constant over the robot's, above which it seems to be of the joint, and not of the motor
OUTDATED_SETTINGS = ("derivative",)  # settings without effect that earlier versions had


def read(folder: Path) -> Study:
    """Read and validate `folder/study.toml`; raises BadStudy with all problems, one a line, then every absent log."""
    missing = "there is no such file; `davinci-forces new` writes one from a log"
    return study_of(toml.read(folder / "study.toml", BadStudy, missing), folder)


def study_of(table: TomlTable, folder: Path) -> Study:
    """Build the study that a whole study.toml describes; raises as `read` does."""
    name = folder.resolve().name
    if name.partition(".")[0].lower() in from_toml.RESERVED:
        table.problem(f"the study's folder is called {name!r}, which is reserved on Windows; rename it")
    title, robot, simulated = table.text("title", name), _robot(table, folder), table.flag("simulated", False)
    overrides = table.table("robot_overrides")
    listed = robot.joints if robot else ()
    robot = _overridden(robot, overrides) if robot else None
    for name, placed in (("tool", _with_tool), ("base", _with_base)):
        if name in table:
            stated = table.table(name)
            try:
                robot = placed(robot, stated)
            except BadRobot as error:
                table.problem(str(error), name)
            stated.close()
    settings = settings_of(table.table("settings"), robot)
    scenario = _haptics(table, folder) if "haptics" in table else HapticScenario()
    baseline = _baseline(table, folder)
    logs = entries_of(table, robot)
    remarks = [*_remarks(table, logs), *(_geared_twice(overrides, listed, robot.joints) if robot else ())]
    table.close()
    lines = lines_of_files(table, logs)
    if table.file.problems():
        for file, line in lines.items():
            if not (folder / file).exists():
                table.file.note(line, f"file {file!r} is not in {folder}")
        _note_missing_clocks(table, logs, folder)
    table.file.refuse(BadStudy)
    assert robot is not None
    truth = toml.read(folder / TRUTH, BadStudy).values if simulated and (folder / TRUTH).exists() else {}
    overridden = {name: values for name, values in overrides.values.items() if values}
    changed = overridden | {name: table.values[name] for name in ("tool", "base") if name in table}
    about = changed, truth, scenario, table.values.get("haptics", ""), baseline, lines, tuple(remarks)
    return Study(folder, title, robot, simulated, settings, logs, *about)


def _note_missing_clocks(table: TomlTable, logs: Sequence[LogEntry], folder: Path) -> None:
    """Note the logs without a clock beside other problems, so that all missing keys are known at once."""
    for i, entry in enumerate(logs):
        if entry.rate or not entry.needs_clock or any(source.quantity == "time" for source in entry.channels):
            continue
        with suppress(BadLog):
            log = open_log(folder / entry.files[0]) if len(entry.files) == 1 else None
            if log and not has_clock(log):
                hint = clock_hint(log)
                either = f"{hint}; or " if hint else ""
                table.problem(f"log {entry.name!r}: rate is missing: write {either}rate = ... [Hz]", "log", i)


def _baseline(table: TomlTable, folder: Path) -> str:
    """The results.json of an earlier report, or ""."""
    if "baseline" not in table:
        return ""
    name = table.text("baseline")
    if not name or not is_inside(name):
        table.problem(f"baseline {name!r} lies outside the study; copy that results.json beside study.toml", "baseline")
    elif not (folder / name).is_file():
        table.problem(f"file {name!r} is not in {folder}; copy a results.json there as {name}", "baseline")
    return name


def _robot(table: TomlTable, folder: Path) -> Robot | None:
    expected = f"one of {', '.join(robots.ROBOTS)}, or a file, {' or '.join(robots.FILES)}"
    name = table.take("robot", None, (str,), expected)
    if name is None:
        return None
    if not is_inside(name):
        table.problem(f"robot {name!r} lies outside the study; copy that file beside study.toml", "robot")
        return None
    try:
        robot, file = robots.read_with_problems(name, folder)
    except BadRobot as error:
        table.problem(str(error), "robot")
        return None
    table.file.named += [file] if file else []
    return robot


def _haptics(table: TomlTable, folder: Path) -> HapticScenario:
    """The haptic scenario in the study's folder; its problems are noted with the problems of the study."""
    name = table.take("haptics", None, (str,), "a .toml file beside the study, as `davinci-forces haptics` takes it")
    if name is None or not is_inside(name):
        table.problem("haptics must name a file inside the study", "haptics")
        return HapticScenario()
    try:
        scenario_table = toml.read(folder / name, BadStudy)
    except BadStudy as error:
        table.problem(str(error), "haptics")
        return HapticScenario()
    table.file.named.append(scenario_table.file)
    return haptics.scenario_of(scenario_table)


def _overridden(robot: Robot, overrides: TomlTable) -> Robot:
    joints = {joint.name: joint for joint in robot.joints}
    for name, changes in overrides.subtables():
        if name in joints:
            joints[name] = from_toml.change(joints[name], changes)
        else:
            overrides.problem(f"{robot.name} has no joint {name!r}; it has {', '.join(joints)}", name)
    return replace(robot, joints=tuple(joints.values()))


def _with_tool(robot: Robot | None, tool: TomlTable) -> Robot | None:
    length = check_positive(tool, "length", tool.number("length", expected="a number of metres", kind="tool"))
    return robot.with_tool(length) if robot and math.isfinite(length) else robot


def _with_base(robot: Robot | None, base: TomlTable) -> Robot | None:
    """The robot on the base that the study states; overridden terms are those of the base, too."""
    rpy = base.numbers("rpy", count=3, expected="roll, pitch and yaw [rad], such as [1.5708, 0.0, 0.0]")
    if rpy and max(map(abs, rpy)) > 2 * math.pi:
        base.problem(f"rpy is in rad, so that {excerpt(list(rpy))} is more than a turn; write degrees as rad", "rpy")
    return robot.with_base((rpy[0], rpy[1], rpy[2])) if robot and rpy else robot


def _remarks(table: TomlTable, logs: Sequence[LogEntry]) -> Iterator[str]:
    """Yield a warning, with its line, for each outdated setting, and for each log of role weight without its mass."""
    for name in table.table("settings").values.keys() & {*OUTDATED_SETTINGS}:
        line = table.file.line(("settings", name))
        yield f"{table.file.name}:{line}: the setting {name!r} no longer has an effect; remove it"
    for i, log in enumerate(logs):
        if log.role == "weight" and log.weight is None:
            why = f"log {log.name!r} has the role weight, but no weight, so no mass is estimated"
            tip = "write weight = { mass = <kg, if known> } for a mass at the tip"
            elsewhere = 'with moves_with = "<joint>", position = [x, y, z] in metres from the remote centre for another'
            yield f"{table.file.name}:{table.file.line(('log', i, 'role'))}: {why}; {tip}, and {elsewhere}"


def _geared_twice(overrides: TomlTable, listed: Sequence[Joint], joints: Sequence[Joint]) -> Iterator[str]:
    """Yield a warning for each torque constant that seems to be at the joint, and is multiplied by the gear ratio."""
    for before, joint in zip(listed, joints, strict=True):
        times = abs(joint.torque_constant / before.torque_constant)
        if times > AT_JOINT and joint.gear_ratio != 1.0 and "gear_ratio" not in overrides.values[joint.name]:
            line = overrides.file.line((*overrides.path, joint.name, "torque_constant"))
            effort = f"1 A of {joint.name} counts as {joint.effort_per_ampere:.3g} {joint.unit('{effort}')}"
            why = f"its torque_constant is {times:.2g} times the robot's, its gear_ratio still {joint.gear_ratio:g}"
            remedy = "if the constant is at the joint, write gear_ratio = 1.0, too"
            yield f"{overrides.file.name}:{line}: {effort}: {why}; {remedy}"


def settings_of(table: TomlTable, robot: Robot | None) -> Settings:
    """Read [settings]; notes the problems of the table."""
    values = {field.name: _setting(table, field) for field in fields(Settings) if field.name != "effort"}
    efforts = table.table("effort")
    table.close(OUTDATED_SETTINGS)
    return Settings(**values, effort=_wanted_effort(efforts, robot))


def _wanted_effort(efforts: TomlTable, robot: Robot | None) -> dict[str, float]:
    names, wanted = [joint.name for joint in robot.joints] if robot else [], {}
    for name in efforts.values:
        if robot and name not in names:
            efforts.problem(f"{robot.name} has no joint {name!r}; it has {', '.join(names)}", name)
        else:
            wanted[name] = check_positive(efforts, name, efforts.number(name, kind="effort"))
    return wanted


def _setting(table: TomlTable, field: Field[Any]) -> Any:
    name: str = field.name
    default: Any = field.default
    if field.type is str:
        return table.text(name, default, CHOICES[name])
    value = table.whole(name, default, -math.inf) if field.type is int else table.number(name, default)
    return check_positive(table, name, value)
