"""A table of a TOML file, read key by key; problems are noted with place and line, not raised one by one."""

import json
import math
import sys
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping
from difflib import get_close_matches
from itertools import chain
from pathlib import Path
from typing import Any

from davinci_forces.errors import BadRequest, PipelineError
from davinci_forces.files import read_bytes, text_of
from davinci_forces.toml.lines import KeyPath, TomlFile, excess, lines_of

MAX_NAME_LENGTH = 100  # characters of an unknown key; a longer key is cut before it is compared with known keys
# Smallest and largest likely size of numbers other than 0, and the unit, by kind: wide enough for micro-robots and for
# excavators.  Beyond it a typing error or a wrong unit is more likely, and results computed from it overflow.  A trace
# may be rounding next to 0.
KINDS = {
    "number": (1e-30, 1e30, ""), "trace": (1e-100, 1e30, ""), "count": (1, 1e6, ""), "seed": (1, 1e40, ""),
    "harmonics": (0, 100, ""), "period": (1e-6, 1e6, "s"), "until": (1e-3, 1e6, "s"), "time": (1e-9, 1e6, "s"),
    "rate": (1e-3, 1e7, "Hz"), "lowpass": (1e-6, 1e5, "Hz"), "tool": (1e-3, 10, "m"), "length": (1e-100, 1e4, "m"),
    "step": (1e-15, 1e4, "m, rad or A"), "motion": (1e-100, 1e9, "rad or m, and their rates"),
    "mass": (1e-15, 1e9, "kg"), "inertia": (1e-100, 1e12, "kg m^2 or kg"), "stiffness": (1e-9, 1e15, "N/m"),
    "damping": (1e-15, 1e15, "N s/m"), "effort": (1e-9, 1e6, "N m or N"), "force": (1e-15, 1e12, "N or N m"),
    "q_tau": (1e-15, 1e6, "effort/s^0.5"), "delay": (1e-3, 10, "s"), "gear_ratio": (1e-6, 1e9, "or rad/m"),
    "torque_constant": (1e-9, 1e6, "N m/A"), "resistance": (1e-9, 1e9, "ohm"), "inductance": (1e-12, 1e6, "H"),
    "current_limit": (1e-9, 1e6, "A"), "voltage_limit": (1e-9, 1e6, "V"), "gain": (1e-12, 1e12, ""),
}  # fmt: skip
KEYS = {
    "time": "skip start end duration lead lag correlation tick position_delay force_delay velocity_filter contact free",
    "length": "d reach surface centre position stops", "step": "encoder_step current_step position_step",
    "motion": "q dq ddq alpha a theta held path plan b a0 stribeck_velocity xyz rpy lower upper velocity",
    "trace": "offset", "mass": "value",
    "force": "strongest tau drift noise peak coulomb static gravity",
    "damping": "viscous bristle_damping", "stiffness": "bristle_stiffness",
    "inertia": "rotor_inertia ixx ixy ixz iyy iyz izz",
    "gain": "motion_scale force_scale friction proportional derivative integral position_p position_i velocity_p "
    "velocity_i current_p current_i multiplier",
    "count": "columns",
}  # fmt: skip
KIND_OF = {key: kind for kind, keys in KEYS.items() for key in keys.split()}


def unlikely(key: str, value: float, kind: str = "") -> str:
    """The problem of the size of a number, "" if it is likely; `kind` is the quantity if the key does not name it."""
    least, most, unit = KINDS[kind or KIND_OF.get(key, key if key in KINDS else "number")]
    if not value or least <= abs(value) <= most:
        return ""
    return f"{key} must lie between {least:g} and {most:g} {unit}".rstrip() + (" in size" if value < 0 else "")


def numbers_of_option(option: str, text: str) -> list[float]:
    """Read the numbers of an option of a command, separated by commas: positions, velocities, lengths or efforts.

    Raises BadRequest if one is not a number, not finite, or of an unlikely size.
    """
    values = []
    for place, word in enumerate(text.split(","), start=1):
        try:
            values.append(float(word))
        except ValueError:
            raise BadRequest(f"{option} {text}: value {place} is {word.strip()!r}, not a number") from None
        if not math.isfinite(values[-1]):
            raise BadRequest(f"{option} {text}: value {place} is {word.strip()}, and must be finite")
        if wrong := unlikely(f"value {place}", values[-1], "motion"):
            raise BadRequest(f"{option} {text}: {wrong}")
    return values


def is_number(value: Any) -> bool:
    """Whether a value of TOML is a number that fits in a float: not inf, not nan, and not too large an integer."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def are_numbers(value: Any, count: int | None = None) -> bool:
    """Whether a value is a list of finite numbers of the length `count`."""
    return isinstance(value, list) and all(map(is_number, value)) and count in (None, len(value))


def excerpt(value: Any) -> str:
    """A value as text for a message; long text is cut."""
    try:
        text = repr(value)
    except ValueError:  # more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:76]} ..."


def in_toml(value: object) -> str:
    """A text, number, truth value, list or table of them as TOML; but for tables, JSON has the same form."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{in_toml(str(key))} = {in_toml(of)}' for key, of in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(in_toml, value))}]"
    return json.dumps(value, ensure_ascii=False)


class TomlTable:
    """One table.  The keys that were asked for are the known ones; `close` and `close_all` report the others.

    A missing or wrong value is noted, and replaced by the default, or by NaN, "", () or an empty table.
    """

    def __init__(self, values: Any, file: TomlFile, path: KeyPath = (), place: str = "", like: str = "") -> None:
        self.file, self.path, self.place, self.asked = file, path, place, dict[str, None]()
        self.values: dict[str, Any] = values if isinstance(values, dict) else {}
        self.opened: list[TomlTable] = []  # tables within this table that were asked for
        if not isinstance(values, dict):
            self.problem(f"must be a table{like and f' such as {like}'}, not {excerpt(values)}")

    def __contains__(self, key: str) -> bool:
        self.asked[key] = None
        return key in self.values

    def problem(self, text: str, *keys: str | int) -> None:
        """Note a problem of this table, or of the value at these keys below it."""
        self.file.note(self.file.line((*self.path, *keys)), f"{self.place}: {text}" if self.place else text)

    def number(
        self, key: str, default: float | None = None, low: float = -math.inf, above: float = -math.inf,
        expected: str = "a number", kind: str = "",
    ) -> float:  # fmt: skip
        """A finite number, at least `low` and greater than `above`, and of a likely size for its key or `kind`."""
        value = self.take(key, default, (int, float), expected)
        if value is None:
            return math.nan
        if not math.isfinite(value) or value < low or value <= above:
            bounds = {f"greater than {above:g}": above, f"at least {low:g}": low}
            demands = " and ".join(["finite", *(words for words, bound in bounds.items() if bound > -math.inf)])
            self.problem(f"{key} must be {demands}, not {value!r}", key)
            return math.nan
        return float(value) if self.likely(key, (value,), kind) else math.nan

    def likely(self, key: str, values: Iterable[float], kind: str = "") -> bool:
        """Whether numbers of the table have likely sizes; the first unlikely number is noted."""
        wrong = next(((text, x) for x in values if key in self.values and (text := unlikely(key, x, kind))), None)
        if wrong:
            self.problem(f"{wrong[0]}, not {excerpt(wrong[1])}", key)
        return not wrong

    def whole(self, key: str, default: int | None = None, low: float = 0) -> int:
        """A whole number, at least `low`."""
        value = self.take(key, default, (int,), "a whole number")
        if value is not None and value < low:
            self.problem(f"{key} must be at least {low}, not {excerpt(value)}", key)
        return 0 if value is None or not self.likely(key, (value,)) else int(value)

    def text(self, key: str, default: str | None = None, choices: Collection[str] = ()) -> str:
        """Text; if choices are given, one of them."""
        expected = f"one of {', '.join(choices)}" if choices else "text"
        value = self.take(key, default, (str,), expected, lambda value: not choices or value in choices)
        return "" if value is None else str(value)

    def flag(self, key: str, default: bool | None = None) -> bool:
        """True or false."""
        return bool(self.take(key, default, (bool,), "true or false"))

    def numbers(
        self, key: str, default: list[float] | None = None, count: int | None = None, expected: str = ""
    ) -> tuple[float, ...]:
        """A list of finite numbers, of length `count` if that is given."""
        expected = expected or f"a list of {'' if count is None else f'{count} '}finite numbers"
        value = self.take(key, default, (list,), expected, lambda value: are_numbers(value, count)) or ()
        return tuple(map(float, value)) if self.likely(key, value) else ()

    def pairs(
        self, key: str, expected: str, default: list[Any] | None = None, least: int = 0
    ) -> tuple[tuple[float, float], ...]:
        """A list of at least `least` pairs of finite numbers."""
        value = self.take(key, default, (list,), expected, lambda value: all(are_numbers(pair, 2) for pair in value))
        if value is not None and len(value) < least:
            self.problem(f"{key} must be {expected}, not {excerpt(value)}", key)
        pairs = tuple((float(a), float(b)) for a, b in value or ())
        return pairs if self.likely(key, chain.from_iterable(pairs)) else ()

    def texts(self, key: str, default: list[str] | None, choices: Collection[str]) -> tuple[str, ...]:
        """A list of one or more of the choices."""
        expected = f"a list of {', '.join(map(repr, choices))}"
        value = self.take(key, default, (list,), expected, lambda value: value and all(x in [*choices] for x in value))
        return tuple(value or ())

    def table(self, key: str, like: str = "") -> "TomlTable":
        """A table within this table; an empty table if the key is missing.  `like` is an example, for messages."""
        self.asked[key] = None
        self.opened.append(TomlTable(self.values.get(key, {}), self.file, (*self.path, key), self._within(key), like))
        return self.opened[-1]

    def subtables(self) -> list[tuple[str, "TomlTable"]]:
        """The tables within this table, by key."""
        return [(key, self.table(key)) for key in self.values]

    def tables(self, key: str, none: str = "", most: int = 1000) -> list["TomlTable"]:
        """The tables of a list, as [[log]], at most so many; if there are none, `none` is the problem to note."""
        expected = f"a list of tables: write [[{key}]]"
        entries = self.take(key, [], (list,), expected, lambda value: all(isinstance(entry, dict) for entry in value))
        if none and self.values.get(key, []) == []:
            self.problem(none, key)
        if len(entries) > most:
            self.problem(f"it has {len(entries)} [[{key}]], more than the {most} allowed; split the file", key, most)
        place, entries = self._within(key), entries[:most]
        tables = [TomlTable(e, self.file, (*self.path, key, i), f"{place} {i + 1}") for i, e in enumerate(entries)]
        self.opened += tables
        return tables

    def unique(self, key: str, name: str, values: Iterable[tuple[int, str]], says: str) -> None:
        """Note the tables of a list that repeat the `name` of an earlier table; `values` are by table number."""
        taken = set[str]()
        for number, value in values:
            if value in taken:
                self.problem(f"{says} {value!r}", key, number, name)
            taken.add(value)

    def take(
        self, key: str, default: Any, kinds: tuple[type, ...], expected: str,
        good: Callable[[Any], object] = lambda value: True,
    ) -> Any:  # fmt: skip
        """The value of a key if it has one of these kinds and is `good`, as `expected` says; otherwise the default."""
        if key not in self:
            if default is None:
                self.problem(f"{key} is missing; it is {expected}")
            return default
        value = self.values[key]
        fits = type(value) is not int or float not in kinds or is_number(value)
        if type(value) in kinds and fits and good(value):
            return value
        self.problem(f"{key} must be {expected}, not {excerpt(value)}", key)
        return default

    def close(self, outdated: Collection[str] = ()) -> None:
        """Report the keys that nothing asked for, except outdated ones, with the likely spelling; each once."""
        unknown = [key for key in self.values if key not in self.asked and key not in outdated]
        for key in unknown:
            near_ones = [] if self.file.is_full else get_close_matches(key[:MAX_NAME_LENGTH], self.asked, 1, 0.5)
            meant = "".join(f"; did you mean {near!r}?" for near in near_ones)
            self.problem(f"unknown key {key!r}; known keys are {', '.join(self.asked) or 'none'}{meant}", key)
        self.asked |= dict.fromkeys(unknown)

    def close_all(self) -> None:
        """Close this table, and all tables within it that were asked for."""
        for table in self.opened:
            table.close_all()
        self.close()

    def _within(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key


MAX_BYTES = 4_000_000  # bytes: ten thousand logs with all their channels; a larger file is a mistake
TOO_LARGE = f"more than the {MAX_BYTES / 1e6:.0f} MB that are read. Is it a log? Split a study this large into several"


def read(file: Path, kind: type[PipelineError], missing: str = "there is no such file") -> TomlTable:
    """Read a file, whose values are checked when they are taken; raises an error of that kind if it cannot."""
    try:
        text = text_of(read_bytes(file, MAX_BYTES, TOO_LARGE), "utf-8-sig")
    except FileNotFoundError:
        raise kind(f"{file}: {missing}") from None
    except OSError as error:
        raise kind(f"{file}: {error.strerror}") from None
    except ValueError as error:  # of UTF-8
        raise kind(f"{file}: {error}") from None
    return parse(text, str(file), kind)


def parse(text: str, name: str, kind: type[PipelineError]) -> TomlTable:
    """Parse a text of TOML, called `name` in problems; raises as `read` does."""
    if wrong := excess(text):
        raise kind(f"{name}:{wrong}; split a study this large into several, and put long lists of numbers into a log")
    try:
        values, lines = tomllib.loads(text), lines_of(text)
    except (ValueError, RecursionError) as error:  # of TOML, and of numbers and nesting beyond Python's limits
        raise kind(f"{name}: {error}") from None
    return TomlTable(values, TomlFile(name, lines))
