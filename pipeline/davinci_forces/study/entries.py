"""Reading the [[log]] tables of a study file."""

import os
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from davinci_forces.logs.binary import EXAMPLE, dtype_of
from davinci_forces.robots import Robot
from davinci_forces.robots.from_toml import wrong_name
from davinci_forces.study import WHOLE, HungMass, LogEntry
from davinci_forces.study.channels import Channels
from davinci_forces.toml import TomlTable, shown
from davinci_forces.toml.lines import MOST_LISTED

MAY_BE_0 = ("skip", "harmonics", "q_tau")
ROLES = ("identification", "validation", "contact", "weight", "tissue", "friction")
TARES = ("validation", "identification")  # roles of logs in which nothing touches the arm
MOST_NAMED = 100  # logs that a problem lists
FARTHEST = 3.0  # [m] from the remote centre, beyond which a position is more likely in another unit
WINDOWS = "a list of [start, end] in seconds, from 0 on"
SEVERAL = ("files", "join")  # keys of several files: parts in order, or side by side
ALL = "all"  # of a tissue log: every sample is one of contact


def optional(table: TomlTable, key: str) -> float | None:
    """A number that may be missing."""
    return checked(table, key, table.number(key)) if key in table else None


def checked(table: TomlTable, key: str, value: float) -> float:
    """A number as it is, noted where it is negative, or 0 and may not be that."""
    if value < 0 or (value == 0 and key not in MAY_BE_0 and key in table.values):
        table.problem(f"{key} must be positive, not {shown(value)}", key)
    return value


def entries_of(study: TomlTable, robot: Robot | None) -> tuple[LogEntry, ...]:
    """Every [[log]]; `robot` is None where the study names none that is known."""
    tables = study.tables("log", "it has no [[log]] table, so there is nothing to analyse", most=MOST_LISTED)
    logs = tuple(_entry(study, i, table, robot) for i, table in enumerate(tables))
    study.unique("log", "name", enumerate(log.name for log in logs), "two logs are named")
    named = {log.name: log for log in logs}
    for i, log in enumerate(logs):
        if log.tare and (wrong := _wrong_tare(log, named)):
            study.problem(f"log {log.name!r}: {wrong}", "log", i, "tare")
    return logs


def lines_of_files(study: TomlTable, logs: Sequence[LogEntry]) -> dict[str, int]:
    """The line that first names each file."""
    lines: dict[str, int] = {}
    for n, log in enumerate(logs):
        key = next((key for key in SEVERAL if ("log", n, key) in study.file.lines), "file")
        for i, file in enumerate(log.files):
            lines.setdefault(file, study.file.line(("log", n, key, i)))
    return lines


def inside(file: str) -> bool:
    """Whether a path stays in the study as it is written; a link that somebody put there may point anywhere."""
    path = Path(file)
    return not path.anchor and Path(os.path.normpath(file)).parts[:1] != ("..",)


def _entry(study: TomlTable, index: int, table: TomlTable, robot: Robot | None) -> LogEntry:
    name = _name(study, index, table)
    table.place = f"log {name!r}"
    entry = LogEntry(
        name=name,
        files=_files(table),
        role=table.text("role", choices=ROLES),
        channels=Channels(table, robot).read(),
        join="join" in table,
        period=optional(table, "period"),
        rate=optional(table, "rate"),
        skip=optional(table, "skip") or 0.0,
        until=_end(table),
        contact=_windows(table, "contact"),
        free=_windows(table, "free"),
        weight=_weight(table, robot),
        tare=table.text("tare", ""),
        delimiter=_delimiter(table),
        decimal=table.text("decimal", choices=(".", ",")) if "decimal" in table else None,
        header=table.flag("header") if "header" in table else None,
        encoding=table.text("encoding") if "encoding" in table else None,
        **_binary(table),
    )
    table.close()
    return entry


def _name(study: TomlTable, index: int, table: TomlTable) -> str:
    if "name" not in table:
        study.problem(f"log {index + 1} has no name", "log", index)
    name = table.text("name", f"log-{index + 1}")
    if wrong := wrong_name(name):
        study.problem(f"log name {wrong}", "log", index, "name")
    return name


def _files(table: TomlTable) -> tuple[str, ...]:
    given = [key for key in ("file", *SEVERAL) if key in table]
    if len(given) != 1:
        table.problem('say either file = "...", or files = ["..."] for parts in order, or join = ["..."] side by side')
        return ()
    [key] = given
    if key in SEVERAL:
        words = "a list of names of files"
        named = table.take(key, [], (list,), words, lambda files: files and all(map(_is_name, files)))
    else:
        named = [table.take("file", "", (str,), "the name of a file", _is_name)]
    for i, file in enumerate(named):
        if not inside(file):
            table.problem(f"{file!r} lies outside the study's folder", key, i)
    return tuple(file for file in named if file and inside(file))


def _is_name(value: object) -> bool:
    return isinstance(value, str) and value != ""


def _end(table: TomlTable) -> float | None:
    """Where the log ends; noted where that is before what is skipped ends."""
    until = optional(table, "until")
    skip = table.values.get("skip", 0.0)
    if until is not None and isinstance(skip, int | float) and 0 < until <= skip:
        problem = f"until = {until:g} leaves nothing after skip = {skip:g}; both count in seconds from the log's first"
        table.problem(f"{problem} sample", "until")
    return until


def _delimiter(table: TomlTable) -> str | None:
    if table.values.get("delimiter") == "":
        table.problem("delimiter must not be empty; leave it out, and it is found from the file", "delimiter")
    return table.text("delimiter") if "delimiter" in table else None


def _binary(table: TomlTable) -> dict[str, Any]:
    """What raw binary numbers are, which such a file does not say itself."""
    for key, other in (("dtype", "columns"), ("columns", "dtype")):
        if key in table and other not in table:
            table.problem(f"{key} is of raw binary numbers, and needs {other}; they say {EXAMPLE}", key)
    said: dict[str, Any] = {}
    if "dtype" in table:
        words = 'a type of number as "float64", "DBL" or "<int16", where < stands for little-endian'
        said["dtype"] = table.take("dtype", None, (str,), words, lambda word: dtype_of(word) is not None)
    if "columns" in table:
        columns = table.take("columns", None, (int, list), "how many numbers a row has, or their names", _are_columns)
        said["columns"] = tuple(columns) if isinstance(columns, list) else columns
    return said


def _are_columns(value: object) -> bool:
    if isinstance(value, list):
        return bool(value) and all(map(_is_name, value)) and len(set(value)) == len(value)
    return isinstance(value, int) and value > 0


def _windows(table: TomlTable, key: str) -> tuple[tuple[float, float], ...]:
    if key == "contact" and key in table and table.values[key] == ALL:
        if table.values.get("role") != "tissue":
            table.problem(f'contact = "{ALL}" is for logs of role tissue; say the windows, {WINDOWS}', key)
        return WHOLE
    windows = table.pairs(key, WINDOWS, [])
    for i, (start, end) in enumerate(windows):
        if not 0 <= start < end:
            table.problem(f"{key} must be {WINDOWS}, not [{start:g}, {end:g}]", key, i)
    return windows


def _wrong_tare(log: LogEntry, named: dict[str, LogEntry]) -> str:
    """What is wrong with a log's tare, or ""."""
    if log.role != "weight":
        return f"tare = {log.tare!r} is for logs of role weight, and this one's is {log.role}"
    tare = named.get(log.tare)
    if tare is None:
        return f"tare = {log.tare!r} is not a log of this study; it has {', '.join(islice(named, MOST_NAMED))}"
    if tare.role not in TARES:
        role = f"its tare {log.tare!r} has the role {tare.role}"
        return f"{role}; a tare is free motion along the same path, of role {' or '.join(TARES)}"
    return ""


def _weight(table: TomlTable, robot: Robot | None) -> HungMass | None:
    if "weight" not in table:
        if table.values.get("role") == "weight":
            table.problem("a weight log says weight = { moves_with = ..., position = ... }, and mass = ... where known")
        return None
    weight = table.table("weight")
    mass = weight.number("mass", above=0.0, words="a number of kg") if "mass" in weight else None
    links = robot.chain.links if robot and robot.chain else ()
    moves_with = weight.text("moves_with", choices=[*(joint.name for joint in robot.joints), *links] if robot else ())
    position = weight.numbers("position", count=3, words="[x, y, z] in metres")
    if position and max(map(abs, position)) > FARTHEST:
        said = f"position must lie within {FARTHEST:g} m of the remote centre, not {list(position)}; it is in metres"
        weight.problem(said, "position")
    weight.close()
    return HungMass(moves_with, (position[0], position[1], position[2]), mass) if position else None
