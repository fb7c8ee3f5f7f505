"""Read the [[log]] tables of a study file."""

import os
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from davinci_forces.logs.binary import BINARY_EXAMPLE, dtype_of
from davinci_forces.logs.log import Options
from davinci_forces.robots import Robot
from davinci_forces.robots.from_toml import wrong_name
from davinci_forces.study import WHOLE_LOG, AttachedMass, LogEntry
from davinci_forces.study.channels import sources_of
from davinci_forces.toml import TomlTable, excerpt
from davinci_forces.toml.lines import MAX_TABLES

ZERO_ALLOWED = ("skip", "harmonics", "q_tau")
ROLES = ("identification", "validation", "contact", "weight", "tissue", "friction")
TARE_ROLES = ("validation", "identification")  # roles of logs in which nothing touches the arm
MAX_LISTED = 100  # names of logs that one message lists
MAX_POSITION = 3.0  # [m] largest coordinate of a position; a larger one is probably in another unit
WINDOWS = "a list of [start, end] in seconds, with 0 <= start < end"
SEVERAL = ("files", "join")  # several files of a log: one after the other in time, or side by side in channels
ALL = "all"  # value of `contact` in a tissue log whose samples are all in contact


def optional_number(table: TomlTable, key: str) -> float | None:
    """Read a number that may be missing; it is positive, or 0 for keys in `ZERO_ALLOWED`."""
    return check_positive(table, key, table.number(key)) if key in table else None


def check_positive(table: TomlTable, key: str, value: float) -> float:
    """Return a number unchanged; report a problem if it is negative, or if it is 0 and must not be."""
    if value < 0 or (value == 0 and key not in ZERO_ALLOWED and key in table.values):
        table.problem(f"{key} must be positive, not {excerpt(value)}", key)
    return value


def entries_of(study: TomlTable, robot: Robot | None) -> tuple[LogEntry, ...]:
    """Read every [[log]]; `robot` is None if the study's robot is unknown."""
    tables = study.tables("log", "it has no [[log]] table, so there is nothing to analyse", most=MAX_TABLES)
    logs = tuple(_entry(study, i, table, robot) for i, table in enumerate(tables))
    study.unique("log", "name", enumerate(log.name for log in logs), "two logs are named")
    by_name = {log.name: log for log in logs}
    for i, log in enumerate(logs):
        if log.tare and (wrong := _wrong_tare(log, by_name)):
            study.problem(f"log {log.name!r}: {wrong}", "log", i, "tare")
    return logs


def lines_of_files(study: TomlTable, logs: Sequence[LogEntry]) -> dict[str, int]:
    """For each log file, the first line of study.toml that names it."""
    lines: dict[str, int] = {}
    for n, log in enumerate(logs):
        key = next((key for key in SEVERAL if ("log", n, key) in study.file.lines), "file")
        for i, file in enumerate(log.files):
            lines.setdefault(file, study.file.line(("log", n, key, i)))
    return lines


def is_inside(file: str) -> bool:
    """Whether a path is inside the study's folder; symbolic links in the folder may point anywhere."""
    path = Path(file)
    return not path.anchor and Path(os.path.normpath(file)).parts[:1] != ("..",)


def _entry(study: TomlTable, index: int, table: TomlTable, robot: Robot | None) -> LogEntry:
    if "name" not in table:
        study.problem(f"log {index + 1} has no name", "log", index)
    name = table.text("name", f"log-{index + 1}")
    if wrong := wrong_name(name):
        study.problem(f"log name {wrong}", "log", index, "name")
    table.place = f"log {name!r}"
    entry = LogEntry(
        name, _files(table), table.text("role", choices=ROLES), sources_of(table, robot), "join" in table,
        period=optional_number(table, "period"), rate=optional_number(table, "rate"),
        skip=optional_number(table, "skip") or 0.0, until=_end(table),
        contact=_windows(table, "contact"), free=_windows(table, "free"), weight=_weight(table, robot),
        tare=table.text("tare", ""), options=_options(table),
    )  # fmt: skip
    _check_apart(table, entry)
    table.close()  # reports unknown keys
    return entry


def _files(table: TomlTable) -> tuple[str, ...]:
    keys = [key for key in ("file", *SEVERAL) if key in table]
    if len(keys) != 1:
        table.problem('give one of file = "...", files = ["..."] (parts in order) or join = ["..."] (side by side)')
        return ()
    [key] = keys
    if key in SEVERAL:
        expected = "a list of file names"
        files = table.take(key, [], (list,), expected, lambda names: names and all(map(_is_name, names)))
    else:
        files = [table.take("file", "", (str,), "a file name", _is_name)]
    for i, file in enumerate(files):
        if not is_inside(file):
            table.problem(f"{file!r} lies outside the study's folder", key, i)
    return tuple(file for file in files if file and is_inside(file))


def _is_name(value: object) -> bool:
    return isinstance(value, str) and value != ""


def _end(table: TomlTable) -> float | None:
    """Read the end of the log [s]; report a problem if the end is not after the skipped start."""
    until = optional_number(table, "until")
    skip = table.values.get("skip", 0.0)
    if until is not None and isinstance(skip, int | float) and 0 < until <= skip:
        end = f"until = {until:g} s leaves no samples after skip = {skip:g} s"
        table.problem(f"{end}; both count from the log's first sample", "until")
    return until


def _options(table: TomlTable) -> Options:
    """Read how the files are read; type and columns are those of raw binary numbers, which have no header."""
    if table.values.get("delimiter") == "":
        table.problem("delimiter must not be empty; leave the key out, and it is detected from the file", "delimiter")
    for key, other_key in (("dtype", "columns"), ("columns", "dtype")):
        if key in table.values and other_key not in table.values:
            table.problem(f"{key} needs {other_key}; a file of raw binary numbers takes {BINARY_EXAMPLE}", key)
    number = 'a type of number as "float64", "DBL" or "<int16", where < stands for little-endian'
    row = "how many numbers a row has, or their names"
    readers: dict[str, Callable[[str], Any]] = {
        "delimiter": table.text,
        "decimal": lambda key: table.text(key, choices=(".", ",")),
        "header": table.flag,
        "encoding": table.text,
        "dtype": lambda key: table.take(key, None, (str,), number, lambda word: dtype_of(word) is not None),
        "columns": lambda key: table.take(key, None, (int, list), row, _are_columns),
    }
    stated = {key: read(key) for key, read in readers.items() if key in table}
    columns = stated.get("columns")
    return Options(**stated | {"columns": tuple(columns) if isinstance(columns, list) else columns})


def _are_columns(value: object) -> bool:
    if isinstance(value, list):
        return bool(value) and all(map(_is_name, value)) and len(set(value)) == len(value)
    return isinstance(value, int) and value > 0


def _windows(table: TomlTable, key: str) -> tuple[tuple[float, float], ...]:
    if key == "contact" and key in table and table.values[key] == ALL:
        if table.values.get("role") != "tissue":
            table.problem(f'contact = "{ALL}" is only for logs of role tissue; give {WINDOWS}', key)
        return WHOLE_LOG
    windows = table.pairs(key, WINDOWS, [])
    for i, (start, end) in enumerate(windows):
        if not 0 <= start < end:
            table.problem(f"{key} must be {WINDOWS}, not [{start:g}, {end:g}]", key, i)
    return windows


def _check_apart(table: TomlTable, entry: LogEntry) -> None:
    """Report a problem for each free window that shares time with a contact window."""
    for i, (start, end) in enumerate(entry.free):
        for first, last in entry.contact if entry.contact != WHOLE_LOG else ():
            if max(start, first) < min(end, last):
                shared = f"{max(start, first):g} to {min(end, last):g} s; shorten one, so that no time is in both"
                table.problem(f"free [{start:g}, {end:g}] and contact [{first:g}, {last:g}] share {shared}", "free", i)


def _wrong_tare(log: LogEntry, by_name: dict[str, LogEntry]) -> str:
    if log.role != "weight":
        return f"tare = {log.tare!r} is only for logs of role weight, but this log has role {log.role}"
    tare = by_name.get(log.tare)
    if tare is None:
        return f"tare = {log.tare!r} is not a log of this study; its logs are {', '.join(islice(by_name, MAX_LISTED))}"
    if tare.role not in TARE_ROLES:
        role = f"its tare {log.tare!r} has role {tare.role}"
        return f"{role}; a tare must be free motion along the same path, with role {' or '.join(TARE_ROLES)}"
    return ""


def _weight(table: TomlTable, robot: Robot | None) -> AttachedMass | None:
    if "weight" not in table:
        return None
    weight = table.table("weight")
    mass = weight.number("mass", above=0.0, expected="a number of kg") if "mass" in weight else None
    if "tare" in weight.values:
        weight.problem(f"write tare = {weight.text('tare')!r} on a line of its own, below weight", "tare")
    if not weight.values.keys() & {"moves_with", "position"}:
        weight.asked |= dict.fromkeys(("moves_with", "position"))
        weight.close()
        return AttachedMass("", None, mass)
    links = robot.chain.links if robot and robot.chain else ()
    moves_with = weight.text("moves_with", choices=[*(joint.name for joint in robot.joints), *links] if robot else ())
    position = weight.numbers("position", count=3, expected="[x, y, z] in metres")
    if position and max(map(abs, position)) > MAX_POSITION:
        must = f"each coordinate of position must lie within {MAX_POSITION:g} m"
        weight.problem(f"{must}, not {list(position)}; it is in metres", "position")
    weight.close()  # reports unknown keys
    return AttachedMass(moves_with, (position[0], position[1], position[2]), mass) if position else None
