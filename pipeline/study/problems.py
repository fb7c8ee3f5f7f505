"""What is wrong with a study file, gathered with the lines it is on, and the checks that many of its keys share."""

import re
from pathlib import Path
from typing import Any

from pipeline.errors import BadStudy
from pipeline.robots.from_toml import is_number

# The least and the greatest value, and the unit: beyond these a slip of the pen or of the unit is the likelier reason.
PLAUSIBLE = {
    "period": (1e-6, 1e6, "s"),
    "rate": (1e-3, 1e7, "Hz"),
    "skip": (0.0, 1e6, "s"),
    "lowpass": (1e-6, 1e5, "Hz"),
    "harmonics": (0, 100, ""),
    "q_tau": (0.0, 1e6, "effort/s^0.5"),
}


def implausible(key: str, value: float) -> str:
    """What is wrong with a number; "" where nothing is."""
    least, most, unit = PLAUSIBLE[key]
    if least <= value <= most:
        return ""
    if value < 0 or (value == 0 and least > 0):
        return f"{key} must be positive, not {value}"
    return f"{key} must lie between {least:g} and {most:g} {unit}".rstrip() + f", not {value}"


class Problems:
    """The problems of one study file; every check adds to them and lets the reading go on."""

    def __init__(self, file: Path, text: str) -> None:
        self.file, self.lines = file, text.splitlines()
        self.noted: set[tuple[int, str]] = set()

    def add(self, line: int, text: str) -> None:
        """Take in one problem."""
        self.noted.add((max(line, 1), text))

    def check(self, good: bool, line: int, problem: str) -> None:
        """Take in a problem, unless all is good."""
        if not good:
            self.add(line, problem)

    def refuse(self) -> None:
        """Raise what was noted, in the order of the file.

        Raises
        ------
        BadStudy
            With every problem, one a line; nothing is raised where there is none.
        """
        if self.noted:
            raise BadStudy("\n".join(f"{self.file}:{line}: {problem}" for line, problem in sorted(self.noted)))

    def start_of_log(self, index: int) -> int:
        """The line of the [[log]] of that index."""
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

    def unknown(self, table: Any, known: tuple[str, ...], place: str, start: int) -> None:
        """Keys of a table that mean nothing."""
        for key in sorted(set(table) - set(known)) if isinstance(table, dict) else ():
            problem = f"{place}: unknown key {key!r}; known are {', '.join(known)}".lstrip(": ")
            self.add(self.line(re.escape(key), start), problem)

    def table(self, parent: dict[str, Any], key: str) -> dict[str, Any]:
        """A table below another; empty where it is not there, or is something else, which is a problem."""
        value = parent.get(key, {})
        if isinstance(value, dict):
            return value
        self.add(self.line(re.escape(key)), f"{key} must be a table, not {value!r}")
        return {}

    def take(self, table: dict[str, Any], key: str, kind: type, default: Any, start: int = 0) -> Any:
        """The value of a key if it is of that kind, else the default."""
        value: Any = table.get(key, default)
        if kind is float and is_number(value):
            value = float(value)
        if key in table and not (type(value) is kind and (kind is not float or is_number(value))):
            words = {str: "text", bool: "true or false", float: "a number", int: "a whole number"}
            self.add(self.line(key, start), f"{key} must be {words[kind]}, not {table[key]!r}")
            return default
        return value

    def positive(self, entry: dict[str, Any], key: str, place: str, start: int) -> float | None:
        """A plausible number, or None where the key is missing or wrong."""
        value: float | None = self.take(entry, key, float, None, start)
        if value is not None and (wrong := implausible(key, value)):
            self.add(self.line(key, start), f"{place}: {wrong}")
            return None
        return value

    def one_of(self, entry: dict[str, Any], key: str, choices: tuple[str, ...], place: str, start: int) -> str:
        """A word out of a few; the key may not be missing."""
        value = entry.get(key)
        if value not in choices:
            line = self.line(key, start) if key in entry else start
            problem = "is missing" if key not in entry else f"must not be {value!r}"
            self.add(line, f"{place}: {key} {problem}; it is one of {', '.join(choices)}")
        return str(value)
