"""Reading `raw/<study>/study.toml`, and saying everything that is wrong with it at once, each with its line."""

import math
import os
import re
import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from pipeline import robots
from pipeline.errors import BadRobot, BadStudy
from pipeline.robots import Kind, Robot
from pipeline.robots.from_toml import change
from pipeline.study import LogEntry, Settings, Source, Study, Weight
from pipeline.units import UNITS, canonical, measures

NAME = re.compile(r"[a-z0-9_-]+")
ROLES = ("identification", "validation", "contact", "weight", "tissue", "friction")
DERIVATIVES = ("harmonics", "fft")

# quantity -> what its unit measures, with the joint's own kind of position and effort left open
OF_A_JOINT = {
    "q": "{position}", "dq": "{position} rate", "theta_m": "angle", "dtheta_m": "angle rate",
    "tau": "{effort}", "i": "current",
}  # fmt: skip
OF_THE_LOG = {
    "time": "time", "depth": "length", "force": "force", "force_x": "force", "force_y": "force", "force_z": "force",
    "tip_x": "length", "tip_y": "length", "tip_z": "length", "push": "count",
}  # fmt: skip


def read(folder: Path) -> Study:
    """Read and validate `folder/study.toml`.  Whether the logs are there is asked by `Study.absent`.

    Raises
    ------
    BadStudy
        With every problem that the file has, one a line.
    """
    file = folder / "study.toml"
    try:
        text = file.read_text(encoding="utf-8-sig")
        table = tomllib.loads(text)
    except FileNotFoundError:
        raise BadStudy(f"{file}: there is no such file; `davinci-forces new` writes one from a log") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadStudy(f"{file}: {error}") from None
    except OSError as error:
        raise BadStudy(f"{file}: {error.strerror}") from None
    return _Reader(file, text).study(table)


class _Reader:
    """Walks the tables of one study file and collects what is wrong with them."""

    def __init__(self, file: Path, text: str) -> None:
        self.file, self.lines = file, text.splitlines()
        self.problems: list[tuple[int, str]] = []

    def study(self, table: dict[str, Any]) -> Study:
        known = ("title", "robot", "simulated", "robot_overrides", "settings", "log")
        self.unknown(table, known, "", 0)
        title = self.take(table, "title", str, self.file.parent.name)
        simulated = self.take(table, "simulated", bool, False)
        robot = self.robot(table)
        settings = self.settings(table.get("settings", {}))
        entries = table.get("log", [])
        if not isinstance(entries, list) or not entries:
            self.problem(0, "it has no [[log]] table, so there is nothing to analyse")
            entries = []
        logs = [self.log(i, entry, robot) for i, entry in enumerate(entries)]
        self.twice([entry.name for entry in logs if entry])
        if self.problems:
            found = sorted(set(self.problems))
            raise BadStudy("\n".join(f"{self.file}:{line}: {problem}" for line, problem in found))
        assert robot is not None
        overrides = table.get("robot_overrides", {})
        own = table["robot"] if table["robot"].endswith(".toml") else ""
        kept = tuple(entry for entry in logs if entry)
        return Study(self.file.parent, title, robot, simulated, settings, kept, overrides, own)

    def robot(self, table: dict[str, Any]) -> Robot | None:
        name = self.take(table, "robot", str, None)
        if name is None:
            self.problem(0, f"robot is missing; it is one of {', '.join(robots.ROBOTS)}, or a .toml file")
            return None
        if name.endswith(".toml") and not self.inside(name):
            self.problem(self.line("robot"), f"robot {name!r} lies outside the study")
            return None
        try:
            robot = robots.load(name, self.file.parent)
        except BadRobot as error:
            self.problem(self.line("robot"), str(error))
            return None
        return self.overridden(robot, table.get("robot_overrides", {}))

    def overridden(self, robot: Robot, overrides: Any) -> Robot:
        joints = {joint.name: joint for joint in robot.joints}
        for name, changes in overrides.items() if isinstance(overrides, dict) else ():
            line = self.line(rf"\[robot_overrides\.\"?{re.escape(name)}\"?\]", exact=False)
            if name not in joints:
                self.problem(line, f"robot_overrides: {robot.name} has no joint {name!r}; it has {', '.join(joints)}")
                continue
            found: list[str] = []
            joints[name] = change(joints[name], changes, f"robot_overrides.{name}", found)
            for problem in found:
                self.problem(line, problem)
        return replace(robot, joints=tuple(joints.values()))

    def settings(self, table: dict[str, Any]) -> Settings:
        names = tuple(f.name for f in fields(Settings))
        self.unknown(table, names, "[settings]", self.line(r"\[settings\]", exact=False))
        values = {f.name: self.take(table, f.name, f.type, f.default) for f in fields(Settings)}  # type: ignore[arg-type]
        for name in ("lowpass", "harmonics", "q_tau"):
            if values[name] < 0 or (name == "lowpass" and values[name] == 0):
                self.problem(self.line(name), f"settings: {name} must be positive, not {values[name]}")
        if values["derivative"] not in DERIVATIVES:
            self.problem(self.line("derivative"), f"settings: derivative is one of {', '.join(DERIVATIVES)}")
        return Settings(**values)

    def log(self, index: int, entry: Any, robot: Robot | None) -> LogEntry | None:
        start = self.start_of_log(index)
        if not isinstance(entry, dict):
            self.problem(start, "log must be a table: write [[log]]")
            return None
        name = self.take(entry, "name", str, f"log-{index + 1}", start)
        if "name" not in entry:
            self.problem(start, f"log {index + 1} has no name")
        elif not NAME.fullmatch(name):
            self.problem(self.line("name", start), f"log name {name!r} must match [a-z0-9_-]+")
        place = f"log {name!r}"
        known = {f.name for f in fields(LogEntry)} | {"file"}
        self.unknown(entry, tuple(sorted(known)), place, start)
        return LogEntry(
            name=name,
            files=self.files(entry, place, start),
            role=self.one_of(entry, "role", ROLES, place, start),
            channels=self.channels(entry.get("channels", {}), robot, place, start),
            period=self.positive(entry, "period", place, start),
            rate=self.positive(entry, "rate", place, start),
            skip=self.positive(entry, "skip", place, start, zero=True) or 0.0,
            contact=self.windows(entry, place, start),
            weight=self.weight(entry, robot, place, start),
            delimiter=self.take(entry, "delimiter", str, None, start),
            decimal=self.one_of(entry, "decimal", (".", ","), place, start) if "decimal" in entry else None,
            header=self.take(entry, "header", bool, None, start),
            encoding=self.take(entry, "encoding", str, None, start),
        )

    def files(self, entry: dict[str, Any], place: str, start: int) -> tuple[str, ...]:
        if ("file" in entry) == ("files" in entry):
            self.problem(start, f'{place}: say either file = "..." or files = ["..."]')
            return ()
        files = entry["files"] if "files" in entry else [entry["file"]]
        if not isinstance(files, list) or not files or not all(isinstance(f, str) and f for f in files):
            self.problem(start, f"{place}: file must be text, and files a list of text")
            return ()
        for file in files:
            if not self.inside(file):
                self.problem(self.line("files?", start), f"{place}: {file!r} lies outside the study's folder")
        return tuple(files)

    def channels(self, table: Any, robot: Robot | None, place: str, start: int) -> tuple[Source, ...]:
        if not isinstance(table, dict) or not table:
            self.problem(start, f"{place}: [log.channels] must say which channel holds which quantity")
            return ()
        sources = [self.source(q, value, robot, place, start) for q, value in _flat(table)]
        good = tuple(s for s in sources if s)
        if robot and len(good) == len(sources):
            self.complete(good, place, start)
        return good

    def complete(self, sources: tuple[Source, ...], place: str, start: int) -> None:
        for joint in dict.fromkeys(s.joint for s in sources if s.joint):
            has = {s.symbol for s in sources if s.joint == joint}
            for either, what in ((("q", "theta_m"), "position"), (("tau", "i"), "effort"), (("dq", "dtheta_m"), "")):
                if what and not has & set(either):
                    self.problem(
                        start, f"{place}: {joint} has no {what}; give {joint}.{either[0]} or {joint}.{either[1]}"
                    )
                if len(has & set(either)) == 2:
                    self.problem(start, f"{place}: {joint} has both {either[0]} and {either[1]}; leave one out")

    def source(self, quantity: str, value: Any, robot: Robot | None, place: str, start: int) -> Source | None:
        line = self.line(re.escape(quantity), start)
        what = self.what(quantity, robot, place, line)
        if what is None:
            return None
        table = value if isinstance(value, dict) else {"channel": value}
        where = f"{place}: channel of {quantity!r}"
        self.unknown(table, ("channel", "unit", "sign", "offset"), where, line)
        channel, unit, sign = table.get("channel"), table.get("unit"), table.get("sign", 1)
        good = isinstance(channel, str) or (type(channel) is int and channel >= 0)
        self.check(good, line, f"{where} must be a name, or a column number from 0, not {channel!r}")
        good_sign = type(sign) is int and sign in (-1, 1)
        self.check(good_sign, line, f"{where}: sign must be 1 or -1, not {sign!r}")
        offset = table.get("offset", 0.0)
        good_offset = type(offset) in (int, float) and math.isfinite(offset)
        self.check(good_offset, line, f"{where}: offset must be a number, not {offset!r}")
        if unit is not None and not self.unit(unit, what, where, line):
            return None
        if not (good and good_sign and good_offset):
            return None
        return Source(quantity, channel, what, canonical(unit) if unit else None, sign, float(offset))  # type: ignore[arg-type]

    def what(self, quantity: str, robot: Robot | None, place: str, line: int) -> str | None:
        joint, _, symbol = quantity.rpartition(".")
        if not joint and quantity in OF_THE_LOG:
            return OF_THE_LOG[quantity]
        if symbol not in OF_A_JOINT or not joint:
            of_joint = ", ".join(f"<joint>.{s}" for s in OF_A_JOINT)
            self.problem(
                line, f"{place}: there is no quantity {quantity!r}; there are {', '.join(OF_THE_LOG)}, {of_joint}"
            )
            return None
        if robot is None:
            return None
        found = next((j for j in robot.joints if j.name == joint), None)
        if found is None:
            names = ", ".join(j.name for j in robot.joints)
            self.problem(line, f"{place}: robot {robot.name} has no joint {joint!r}; it has {names}")
            return None
        position, effort = ("angle", "torque") if found.kind is Kind.REVOLUTE else ("length", "force")
        return OF_A_JOINT[symbol].format(position=position, effort=effort)

    def unit(self, unit: Any, what: str, where: str, line: int) -> bool:
        if not isinstance(unit, str) or measures(unit) is None:
            self.problem(line, f"{where}: unknown unit {unit!r}; known are {', '.join(UNITS)}")
            return False
        if measures(unit) != what:
            self.problem(line, f"{where}: {unit!r} measures {measures(unit)}, but {what} is needed")
            return False
        return True

    def windows(self, entry: dict[str, Any], place: str, start: int) -> tuple[tuple[float, float], ...]:
        windows = entry.get("contact", [])
        good = isinstance(windows, list) and all(
            isinstance(w, list) and len(w) == 2 and all(type(x) in (int, float) for x in w) and w[0] < w[1]
            for w in windows
        )
        self.check(good, self.line("contact", start), f"{place}: contact must be a list of [start, end] in seconds")
        return tuple((float(a), float(b)) for a, b in windows) if good else ()

    def weight(self, entry: dict[str, Any], robot: Robot | None, place: str, start: int) -> Weight | None:
        table, line = entry.get("weight"), self.line("weight", start)
        if table is None:
            if entry.get("role") == "weight":
                self.problem(
                    start, f"{place}: a weight log says weight = {{ mass = ..., moves_with = ..., position = ... }}"
                )
            return None
        if not isinstance(table, dict):
            self.problem(line, f"{place}: weight must be a table")
            return None
        self.unknown(table, ("mass", "moves_with", "position"), f"{place}: weight", line)
        mass, joint, position = table.get("mass"), table.get("moves_with"), table.get("position")
        three = isinstance(position, list) and len(position) == 3 and all(type(x) in (int, float) for x in position)
        names = [j.name for j in robot.joints] if robot else [joint]
        good = type(mass) in (int, float) and mass > 0
        self.check(good, line, f"{place}: weight.mass must be positive, in kg")
        self.check(joint in names, line, f"{place}: weight.moves_with must be one of {', '.join(map(str, names))}")
        self.check(three, line, f"{place}: weight.position must be [x, y, z] in metres")
        return Weight(float(mass), str(joint), tuple(map(float, position))) if good and three else None  # type: ignore

    def take(self, table: dict[str, Any], key: str, kind: type, default: Any, start: int = 0) -> Any:
        value = table.get(key, default)
        if kind is float and type(value) is int:
            value = float(value)
        if key in table and (type(value) is not kind or (kind is float and not math.isfinite(value))):
            words = {str: "text", bool: "true or false", float: "a number", int: "a whole number"}
            self.problem(self.line(key, start), f"{key} must be {words[kind]}, not {table[key]!r}")
            return default
        return value

    def positive(self, entry: dict[str, Any], key: str, place: str, start: int, zero: bool = False) -> float | None:
        value: float | None = self.take(entry, key, float, None, start)
        if value is not None and (value < 0 or (value == 0 and not zero)):
            self.problem(self.line(key, start), f"{place}: {key} must be positive, not {value}")
            return None
        return value

    def one_of(self, entry: dict[str, Any], key: str, choices: tuple[str, ...], place: str, start: int) -> str:
        value = entry.get(key)
        if value not in choices:
            line = self.line(key, start) if key in entry else start
            says = "is missing" if key not in entry else f"must not be {value!r}"
            self.problem(line, f"{place}: {key} {says}; it is one of {', '.join(choices)}")
        return str(value)

    def unknown(self, table: Any, known: tuple[str, ...], place: str, start: int) -> None:
        for key in sorted(set(table) - set(known)) if isinstance(table, dict) else ():
            self.problem(
                self.line(re.escape(key), start),
                f"{place}: unknown key {key!r}; known are {', '.join(known)}".lstrip(": "),
            )

    def twice(self, names: list[str]) -> None:
        for name in sorted({n for n in names if names.count(n) > 1}):
            self.problem(self.start_of_log(len(names) - 1 - names[::-1].index(name)), f"two logs are named {name!r}")

    def inside(self, file: str) -> bool:
        """Whether a path stays in the study as it is written; a link that somebody put there may point anywhere."""
        path = Path(file)
        return not path.is_absolute() and not path.drive and not os.path.normpath(file).startswith("..")

    def check(self, good: bool, line: int, problem: str) -> None:
        if not good:
            self.problem(line, problem)

    def problem(self, line: int, text: str) -> None:
        self.problems.append((max(line, 1), text))

    def start_of_log(self, index: int) -> int:
        starts = [i for i, line in enumerate(self.lines, start=1) if re.match(r"\s*\[\[\s*log\s*\]\]", line)]
        return starts[index] if index < len(starts) else 1

    def line(self, key: str, start: int = 0, exact: bool = True) -> int:
        """The line that a key is on, from a line onwards and within its [[log]]; where it is not found, that line."""
        pattern = re.compile(rf"""\s*["']?{key}["']?\s*=""" if exact else rf"\s*{key}")
        for number, line in enumerate(self.lines[max(start - 1, 0) :], start=max(start, 1)):
            if number > start > 0 and re.match(r"\s*\[\[", line):
                break
            if pattern.match(line):
                return number
        return start


def _flat(table: dict[str, Any]) -> list[tuple[str, Any]]:
    """Channels by quantity: `hand_roll.q = ...` without quotes is a table of TOML and means the same."""
    flat: list[tuple[str, Any]] = []
    for key, value in table.items():
        nested = isinstance(value, dict) and "channel" not in value and set(value) <= set(OF_A_JOINT)
        flat += [(f"{key}.{symbol}", v) for symbol, v in value.items()] if nested and value else [(key, value)]
    return flat
