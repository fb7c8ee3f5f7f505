"""Units of the quantities in logs, their size in SI, and the units that names of channels state."""

import math
import re
from functools import lru_cache

SIZES = {  # what units measure -> their sizes in SI
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": 2 * math.pi},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86400.0},
    "current": {"A": 1.0, "mA": 1e-3},
    "force": {"N": 1.0, "mN": 1e-3},
    "torque": {"N m": 1.0, "mN m": 1e-3},
}
UNITS = {unit: (kind, size) for kind, sizes in SIZES.items() for unit, size in sizes.items()}
UNITS |= {f"{u}/s": (f"{kind} rate", size) for u, (kind, size) in UNITS.items() if kind in ("angle", "length")}
UNITS["rpm"] = ("angle rate", 2 * math.pi / 60)

# the default units, where neither the study nor the log states one
SI = {
    "angle": "rad", "length": "m", "angle rate": "rad/s", "length rate": "m/s", "time": "s", "current": "A",
    "force": "N", "torque": "N m", "count": "",
}  # fmt: skip

# other words for units, in lower case, without blanks, and without the s of the plural
SPELLINGS = {
    "°": "deg", "degree": "deg", "radian": "rad", "revolution": "rev", "turn": "rev", "meter": "m", "metre": "m",
    "millimeter": "mm", "millimetre": "mm", "sec": "s", "second": "s", "msec": "ms", "millisec": "ms",
    "millisecond": "ms", "usec": "us", "microsec": "us", "microsecond": "us", "nsec": "ns", "nanosec": "ns",
    "nanosecond": "ns", "minute": "min", "hour": "h", "amp": "a", "ampere": "a", "milliamp": "ma", "newton": "n",
    "newtonmeter": "nm", "newtonmetre": "nm", "nmm": "mnm", "dps": "deg/s", "rps": "rev/s", "mps": "m/s",
    "1/min": "rpm", "/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "u/min": "rpm",
}  # fmt: skip
LISTED = {unit.lower().replace(" ", ""): unit for unit in UNITS}
# words for units that no quantity has: counts have no size, and kg or lb of force depend on their definition
UNSIZED = {
    "count", "cnt", "tick", "pulse", "inc", "lsb", "adc", "volt", "v", "mv", "percent", "pct", "permille", "%",
    "kg", "kgf", "gf", "g", "lbf", "lb", "inch", "inches", "kn", "knm", "ncm", "ua", "mdeg", "grad", "gon",
}  # fmt: skip
DATES = (9.4e8, 4.2e9)  # [s] since 1970, of the years 2000 to 2100
TIME_WORDS = ("time", "t", "elapsed", "timestamp", "stamp", "clock", "duration")
# words that are units only after these words: `time_min` is in minutes, but `q_min` is a minimum
ONLY_AFTER = {
    **dict.fromkeys(("s", "min", "h", "day"), TIME_WORDS), "A": ("current", "curr", "i"), "N": ("force", "load"),
    "m": ("depth", "displacement"), "g": ("load", "weight"), "v": ("force", "load", "sensor"),
}  # fmt: skip
IN_BRACKETS = re.compile(r"(?<=\S)\s*[\[({]\s*([^\[\](){}]*?)\s*[\])}]")
INDEX = re.compile(r"\d*|[^\W\d]\w*_\w*|[^\W\d]+ ?\d+")  # `q[0]`, `effort[outer_yaw]`, `q (joint 1)`
RATE = re.compile(r"[\s,_]+([^\W\d_]+|°)$")  # of `speed deg`, before a slash and a time
OUTSIDE = r"(?![^\[({]*[\])}])"  # what precedes this is not in brackets
GROUP = re.compile(f"/{OUTSIDE}")  # a slash after the name of a group
CAPITAL = re.compile(r"(?<=[a-z]{3})(?=m(?:A|Nm?)$)|(?<=[a-z])(?=[A-Z])")  # `currentmA`, `angleDeg`


@lru_cache(maxsize=1024)
def canonical(unit: str) -> str:
    """The listed spelling of a unit, or the unit as it stands."""
    unit = unit.strip()
    if unit in UNITS or (len(unit) == 1 and unit != "°"):
        return unit
    text = re.sub(r"[\s·*.]*\b(s|min)(?:\^?-1|⁻¹)$|\s+per\s+", r"/\1", re.sub("[µμ]", "u", unit.lower()))
    text = "/".join(_spelled(re.sub(r"[\s·*.()-]", "", part)) for part in text.split("/"))
    return LISTED.get(_spelled(text), unit)


def _spelled(word: str) -> str:
    singular = word.removesuffix("s") if len(word) > 3 else word
    return SPELLINGS.get(word, SPELLINGS.get(singular, singular if singular in LISTED else word))


def unit_in(name: str) -> str:
    """The unit that a channel's name states, as in `q [deg]`, `time / ms`, `q_deg` or `posDeg`, else ""."""
    return split_ratio(name)[1] or _in_brackets(name) or unit_among_words(name)


def unit_after_groups(name: str) -> str:
    """The unit that the name of a channel in groups states: `arm/1/speed [deg/s]`, `arm/speed deg/s`."""
    parts = GROUP.split(name)
    rate = split_ratio("/".join(parts[-2:]))[1]
    return rate if "/" in rate else unit_in(parts[-1].strip())


def split_ratio(name: str) -> tuple[str, str]:
    """Split `time / ms`, a quantity over its unit, or `speed deg/s` into both; the unit of any other name is ""."""
    for slash in re.finditer("/", name if "/" in name and not measures(name) else ""):
        quantity, unit = name[: slash.start()].strip(), name[slash.end() :].strip()
        if not quantity.startswith("/") and not re.search(r"[\[({][^\])}]*$", quantity) and quantity and _is_unit(unit):
            rate = RATE.search(quantity)
            if rate and measures(f"{rate[1]}/{unit}"):
                return quantity[: rate.start()], f"{rate[1]}/{unit}"
            return quantity, unit.strip("()")
    return name, ""


def _is_unit(word: str) -> bool:
    return bool(measures(word)) or word.lower().removesuffix("s") in UNSIZED


def _in_brackets(name: str) -> str:
    """The last listed unit in brackets, or whatever the brackets at the end of a name hold that is no index."""
    brackets = [match for match in IN_BRACKETS.finditer(name) if not INDEX.fullmatch(match[1]) or measures(match[1])]
    listed = [match[1] for match in brackets if measures(match[1])]
    return listed[-1] if listed else next((match[1] for match in brackets if match.end() == len(name.rstrip())), "")


def unit_among_words(name: str) -> str:
    """The last unit among the words of a name but for the first, as in `q_deg`, or the name that is a unit itself."""
    if measures(name) and len(canonical(name)) > 1:
        return name
    words = re.findall(r"[^\W\d_]+|[°%]", name.rpartition("/")[2] if name.startswith("/") else name)
    units = (_unit_at(words, i) for i in reversed(range(len(words))))
    return next(filter(None, units), "")


def _unit_at(words: list[str], i: int) -> str:
    """The unit that begins at a word: `deg_per_s`, `deg_s`, `N_m`, `deg`, or the end of `posDeg`."""
    tails = [words[i][match.start() :] for match in CAPITAL.finditer(words[i])]
    joined = ["/".join(words[i : i + 2]), *(" ".join(words[i : i + n]) for n in (3, 2, 1))] if i else []
    for word in [*joined, *(CAPITAL.sub(" ", tail) for tail in tails)]:
        unit = canonical(LISTED.get(word.lower(), word))
        before = ONLY_AFTER.get(unit if unit in UNITS else unit.lower())
        if word.lower() == "rev":
            return "rev?"  # revolutions, or reverse: unlisted, so that the study has to say it
        if _is_unit(unit) and (before is None or (i and words[i - 1].lower() in before) or len(word) > 4):
            return unit
    return ""


def measures(unit: str) -> str | None:
    """The kind of quantity of a unit, or None for a unit that is not listed."""
    return UNITS.get(canonical(unit), (None, 0.0))[0]


def since_1970(t: float) -> str:
    """The unit in which a time since 1970 is a date of `DATES`: s, ms, us or ns; "" if it is none."""
    return next((unit for unit in ("s", "ms", "us", "ns") if DATES[0] < t * size(unit) < DATES[1]), "")


def size(unit: str) -> float:
    """The size of a unit in SI."""
    return UNITS[canonical(unit)][1]
