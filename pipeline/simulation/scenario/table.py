"""A table of a scenario file, read key by key; what is wrong is collected with its place, not raised one by one."""

import math
from collections.abc import Iterable
from typing import Any


class TomlTable:
    """One table.  The keys that were asked for are the known ones; `close` reports the others."""

    def __init__(self, values: Any, place: str, problems: list[str]) -> None:
        self.place, self.problems, self.asked = place, problems, list[str]()
        self.values: dict[str, Any] = values if isinstance(values, dict) else {}
        if not isinstance(values, dict):
            self.problem(f"must be a table, not {values!r}")

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def problem(self, text: str) -> None:
        """Note something wrong with this table."""
        self.problems.append(f"{self.place}: {text}" if self.place else text)

    def number(self, key: str, default: float | None = None, low: float = -math.inf, above: float = -math.inf) -> float:
        """A finite number, at least `low` and greater than `above`."""
        value = self._take(key, default, (int, float), "a number")
        if value is None:
            return math.nan
        if not math.isfinite(value) or value < low or value <= above:
            bounds = {f"greater than {above:g}": above, f"at least {low:g}": low}
            demands = " and ".join(["finite", *(words for words, bound in bounds.items() if bound > -math.inf)])
            self.problem(f"{key} must be {demands}, not {value!r}")
            return math.nan
        return float(value)

    def whole(self, key: str, default: int | None = None, low: int = 0) -> int:
        """A whole number, at least `low`."""
        value = self._take(key, default, (int,), "a whole number")
        if value is not None and value < low:
            self.problem(f"{key} must be at least {low}, not {value}")
        return low if value is None else int(value)

    def text(self, key: str, default: str | None = None, choices: Iterable[str] = ()) -> str:
        """Text, one of the choices where there are any."""
        value = self._take(key, default, (str,), "text")
        choices = tuple(choices)
        if choices and value is not None and value not in choices:
            self.problem(f"{key} must be one of {', '.join(choices)}, not {value!r}")
        return "" if value is None else str(value)

    def numbers(self, key: str, default: list[float] | None = None, count: int | None = None) -> tuple[float, ...]:
        """A list of finite numbers, as many as asked for."""
        value = self._take(key, default, (list,), "a list of numbers")
        if value is None:
            return ()
        good = all(type(x) in (int, float) and math.isfinite(x) for x in value)
        if not good or (count is not None and len(value) != count):
            many = "finite numbers" if count is None else f"{count} finite numbers"
            self.problem(f"{key} must be a list of {many}, not {value!r}")
            return ()
        return tuple(map(float, value))

    def pairs(self, key: str) -> tuple[tuple[float, float], ...]:
        """A list of two or more pairs of finite numbers."""
        value = self._take(key, None, (list,), "a list of pairs of numbers")
        good = isinstance(value, list) and len(value) > 1 and all(isinstance(pair, list) for pair in value)
        if not good or not all(
            len(p) == 2 and all(type(x) in (int, float) and math.isfinite(x) for x in p) for p in value
        ):
            self.problem(f"{key} must be a list of two or more pairs of numbers, not {value!r}")
            return ()
        return tuple((float(a), float(b)) for a, b in value)

    def texts(self, key: str, default: list[str], choices: Iterable[str]) -> tuple[str, ...]:
        """A list of some of the choices."""
        value = self._take(key, default, (list,), "a list of text")
        if not value or not set(map(str, value)) <= set(choices):
            self.problem(f"{key} must be some of {', '.join(choices)}, not {value!r}")
            return ()
        return tuple(value)

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        return bool(self._take(key, default, (bool,), "true or false"))

    def each(self) -> list[tuple[str, "TomlTable"]]:
        """The tables that this one is made of, by key."""
        return [(key, self.table(key)) for key in self.values]

    def table(self, key: str) -> "TomlTable":
        """A table within this one; an empty one where it is missing."""
        self.asked.append(key)
        return TomlTable(self.values.get(key, {}), self._within(key), self.problems)

    def tables(self, key: str) -> list["TomlTable"]:
        """The tables of a list, such as [[log]]; none where it is missing."""
        self.asked.append(key)
        entries = self.values.get(key, [])
        if not isinstance(entries, list):
            self.problem(f"{key} must be a list of tables, not {entries!r}")
            return []
        return [TomlTable(entry, self._within(f"{key} {i}"), self.problems) for i, entry in enumerate(entries, start=1)]

    def close(self) -> None:
        """Report the keys that nothing asked for."""
        for key in sorted(set(self.values) - set(self.asked)):
            self.problem(f"unknown key {key!r}; known are {', '.join(sorted(set(self.asked)))}")

    def _take(self, key: str, default: Any, kinds: tuple[type, ...], words: str) -> Any:
        self.asked.append(key)
        if key not in self.values and default is None:
            self.problem(f"{key} is missing; it is {words}")
        value = self.values.get(key, default)
        if type(value) not in kinds:
            if key in self.values:
                self.problem(f"{key} must be {words}, not {value!r}")
            return default
        return value

    def _within(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key
