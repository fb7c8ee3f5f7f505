"""Reading `raw/<study>/study.toml`, and saying everything that is wrong with it at once, each with its line."""

import os
import re
import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from pipeline import robots
from pipeline.errors import BadRobot, BadStudy
from pipeline.estimators import ESTIMATORS
from pipeline.robots import Robot
from pipeline.robots.from_toml import RESERVED, change, is_number, wrong_name
from pipeline.robots.models import MODELS
from pipeline.study import LogEntry, Settings, Study, Weight
from pipeline.study.channels import Channels
from pipeline.study.problems import Problems, implausible

ROLES = ("identification", "validation", "contact", "weight", "tissue", "friction")
CHOICES = {
    "derivative": ("harmonics", "fft"),
    "fit": tuple(f"{model}.{estimator}" for model in MODELS for estimator in ESTIMATORS),
}


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
    except OSError as error:
        raise BadStudy(f"{file}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, of numbers and nesting beyond Python's limits
        raise BadStudy(f"{file}: {error}") from None
    return _Reader(folder, Problems(file, text)).study(table)


class _Reader:
    """Walks the tables of one study file and collects what is wrong with them."""

    def __init__(self, folder: Path, problems: Problems) -> None:
        self.folder, self.problems = folder, problems

    def study(self, table: dict[str, Any]) -> Study:
        known = ("title", "robot", "simulated", "robot_overrides", "settings", "log")
        self.problems.unknown(table, known, "", 0)
        name = self.folder.resolve().name
        if name.partition(".")[0].lower() in RESERVED:
            self.problems.add(0, f"the study's folder is called {name!r}, which is reserved on Windows; rename it")
        title = self.problems.take(table, "title", str, name)
        simulated = self.problems.take(table, "simulated", bool, False)
        robot = self.robot(table)
        settings = self.settings(self.problems.table(table, "settings"))
        entries = table.get("log", [])
        if not isinstance(entries, list) or not entries:
            self.problems.add(0, "it has no [[log]] table, so there is nothing to analyse")
            entries = []
        logs = [self.log(i, entry, robot) for i, entry in enumerate(entries)]
        self.twice([entry.name for entry in logs if entry])
        self.problems.refuse()
        assert robot is not None
        overrides = self.problems.table(table, "robot_overrides")
        own = table["robot"] if table["robot"].endswith(".toml") else ""
        kept = tuple(entry for entry in logs if entry)
        return Study(
            self.folder, title, robot, simulated, settings, kept, overrides, self.truth() if simulated else {}, own
        )

    def truth(self) -> dict[str, Any]:
        """The ground truth of a simulated study, where its folder has a truth.toml."""
        try:
            return tomllib.loads((self.folder / "truth.toml").read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, RecursionError) as error:
            raise BadStudy(f"{self.folder / 'truth.toml'}: {error}") from None

    def robot(self, table: dict[str, Any]) -> Robot | None:
        name = self.problems.take(table, "robot", str, None)
        if name is None:
            self.problems.add(0, f"robot is missing; it is one of {', '.join(robots.ROBOTS)}, or a .toml file")
            return None
        if name.endswith(".toml") and not self.inside(name):
            self.problems.add(self.problems.line("robot"), f"robot {name!r} lies outside the study")
            return None
        try:
            robot = robots.load(name, self.folder)
        except BadRobot as error:
            self.problems.add(self.problems.line("robot"), str(error))
            return None
        return self.overridden(robot, self.problems.table(table, "robot_overrides"))

    def overridden(self, robot: Robot, overrides: dict[str, Any]) -> Robot:
        joints = {joint.name: joint for joint in robot.joints}
        for name in overrides:
            changes = self.problems.table(overrides, name)
            line = self.problems.line(rf"\[robot_overrides\.\"?{re.escape(name)}\"?\]", exact=False)
            if name not in joints:
                known = ", ".join(joints)
                self.problems.add(line, f"robot_overrides: {robot.name} has no joint {name!r}; it has {known}")
                continue
            mistakes: list[str] = []
            joints[name] = change(joints[name], changes, f"robot_overrides.{name}", mistakes)
            for problem in mistakes:
                self.problems.add(line, problem)
        return replace(robot, joints=tuple(joints.values()))

    def settings(self, table: dict[str, Any]) -> Settings:
        names = tuple(f.name for f in fields(Settings))
        self.problems.unknown(table, names, "[settings]", self.problems.line(r"\[settings\]", exact=False))
        values = {
            f.name: self.problems.take(table, f.name, f.type, f.default)  # type: ignore[arg-type]
            for f in fields(Settings)
        }
        for name in ("lowpass", "harmonics", "q_tau"):
            if wrong := implausible(name, values[name]):
                self.problems.add(self.problems.line(name), f"settings: {wrong}")
        for name, choices in CHOICES.items():
            problem = f"settings: {name} must not be {values[name]!r}; it is one of {', '.join(choices)}"
            self.problems.check(values[name] in choices, self.problems.line(name), problem)
        return Settings(**values)

    def log(self, index: int, entry: Any, robot: Robot | None) -> LogEntry | None:
        start = self.problems.start_of_log(index)
        if not isinstance(entry, dict):
            self.problems.add(start, "log must be a table: write [[log]]")
            return None
        name = self.problems.take(entry, "name", str, f"log-{index + 1}", start)
        if "name" not in entry:
            self.problems.add(start, f"log {index + 1} has no name")
        elif wrong := wrong_name(name):
            self.problems.add(self.problems.line("name", start), f"log name {wrong}")
        place = f"log {name!r}"
        known = {f.name for f in fields(LogEntry)} | {"file"}
        self.problems.unknown(entry, tuple(sorted(known)), place, start)
        return LogEntry(
            name=name,
            files=self.files(entry, place, start),
            role=self.problems.one_of(entry, "role", ROLES, place, start),
            channels=Channels(self.problems, robot, place, start).read(entry.get("channels", {})),
            period=self.problems.positive(entry, "period", place, start),
            rate=self.problems.positive(entry, "rate", place, start),
            skip=self.problems.positive(entry, "skip", place, start) or 0.0,
            contact=self.windows(entry, place, start),
            weight=self.weight(entry, robot, place, start),
            delimiter=self.delimiter(entry, place, start),
            decimal=self.problems.one_of(entry, "decimal", (".", ","), place, start) if "decimal" in entry else None,
            header=self.problems.take(entry, "header", bool, None, start),
            encoding=self.problems.take(entry, "encoding", str, None, start),
        )

    def files(self, entry: dict[str, Any], place: str, start: int) -> tuple[str, ...]:
        if ("file" in entry) == ("files" in entry):
            self.problems.add(start, f'{place}: say either file = "..." or files = ["..."]')
            return ()
        files = entry["files"] if "files" in entry else [entry["file"]]
        if not isinstance(files, list) or not files or not all(isinstance(f, str) and f for f in files):
            self.problems.add(start, f"{place}: file must be text, and files a list of text")
            return ()
        line = self.problems.line("files?", start)
        for file in files:
            self.problems.check(self.inside(file), line, f"{place}: {file!r} lies outside the study's folder")
        return tuple(files)

    def delimiter(self, entry: dict[str, Any], place: str, start: int) -> str | None:
        delimiter: str | None = self.problems.take(entry, "delimiter", str, None, start)
        problem = f"{place}: delimiter must not be empty; leave it out, and it is found from the file"
        self.problems.check(delimiter != "", self.problems.line("delimiter", start), problem)
        return delimiter

    def windows(self, entry: dict[str, Any], place: str, start: int) -> tuple[tuple[float, float], ...]:
        windows = entry.get("contact", [])
        good = isinstance(windows, list) and all(
            isinstance(w, list) and len(w) == 2 and all(map(is_number, w)) and 0 <= w[0] < w[1] for w in windows
        )
        line = self.problems.line("contact", start)
        self.problems.check(good, line, f"{place}: contact must be a list of [start, end] in seconds, from 0 on")
        return tuple((float(a), float(b)) for a, b in windows) if good else ()

    def weight(self, entry: dict[str, Any], robot: Robot | None, place: str, start: int) -> Weight | None:
        table, line = entry.get("weight"), self.problems.line("weight", start)
        if table is None:
            if entry.get("role") == "weight":
                problem = "a weight log says weight = { mass = ..., moves_with = ..., position = ... }"
                self.problems.add(start, f"{place}: {problem}")
            return None
        if not isinstance(table, dict):
            self.problems.add(line, f"{place}: weight must be a table")
            return None
        self.problems.unknown(table, ("mass", "moves_with", "position"), f"{place}: weight", line)
        mass: Any = table.get("mass")
        position: Any = table.get("position")
        joint = table.get("moves_with")
        names = [j.name for j in robot.joints] if robot else [joint]
        known = ", ".join(map(str, names))
        heavy = is_number(mass) and mass > 0
        three = isinstance(position, list) and len(position) == 3 and all(map(is_number, position))
        self.problems.check(heavy, line, f"{place}: weight.mass must be positive, in kg")
        self.problems.check(joint in names, line, f"{place}: weight.moves_with must be one of {known}")
        self.problems.check(three, line, f"{place}: weight.position must be [x, y, z] in metres")
        if not (heavy and three):
            return None
        x, y, z = map(float, position)
        return Weight(float(mass), str(joint), (x, y, z))

    def twice(self, names: list[str]) -> None:
        for name in sorted({n for n in names if names.count(n) > 1}):
            last = len(names) - 1 - names[::-1].index(name)
            self.problems.add(self.problems.start_of_log(last), f"two logs are named {name!r}")

    def inside(self, file: str) -> bool:
        """Whether a path stays in the study as it is written; a link that somebody put there may point anywhere."""
        path = Path(file)
        return not path.anchor and Path(os.path.normpath(file)).parts[:1] != ("..",)
