"""Convert dates and times of day in the cells of a text log to seconds: ISO 8601, HH:MM:SS, and other orders."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from davinci_forces.logs.cells import absent, integers
from davinci_forces.maths.arrays import Array

CLOCK = r"\d?\d:\d\d:\d\d(?:[.,]\d+)?"
DATE = r"\d{4}[-/]\d\d[-/]\d\d"
ZONE = r"\s?(?:Z|[+-]\d\d(?::?\d\d)?)"
HALF = r"(?P<half>\s?[AaPp]\.?[Mm]\.?)?"  # of the day
OTHER_DATE = rf"(\d\d?)([./-])(\d\d?)\2\d{{4}}(?:[.,]?[T ]+\d?\d:\d\d(?::\d\d(?:[.,]\d+)?)?{HALF})"
MONTH_NAMES = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
NAMED_DATE = rf"\d\d?[- ](?:{'|'.join(MONTH_NAMES)})[- ]\d{{4}} {CLOCK}"
MOMENT = re.compile(rf"{DATE}[T ]\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?(?P<zone>{ZONE})?", re.ASCII)
DAY_FIRST, MONTH_FIRST = (re.compile(rf"(?#{order}){OTHER_DATE}", re.ASCII) for order in ("d/m", "m/d"))
MONTH_NAMED = re.compile(NAMED_DATE, re.ASCII | re.IGNORECASE)
COMPACT = re.compile(r"20\d\d[01]\d[0-3]\d[T_ -]?[0-2]\d[0-5]\d[0-5]\d(?:[.,]\d+)?", re.ASCII)
TIME_OF_DAY = re.compile(CLOCK + HALF, re.ASCII)
DAY_ALONE = re.compile(rf"{DATE}|\d\d?([./-])\d\d?\1\d{{4}}", re.ASCII)
PADDED = ((r"-0(\d\d)", r"-\1"), (r" (\d):", r" 0\1:"))
# how the cells of each pattern become ISO 8601
REWRITTEN: dict[re.Pattern[str], tuple[tuple[str, str], ...]] = {
    MOMENT: ((r"\s+([Z+-])", r"\1"), ("/", "-")),
    DAY_FIRST: ((r"^(\d+)[./-](\d+)[./-](\d+)\.?[T ]+", r"\3-0\2-0\1 "), *PADDED),
    MONTH_FIRST: ((r"^(\d+)[./-](\d+)[./-](\d+)\.?[T ]+", r"\3-0\1-0\2 "), *PADDED),
    MONTH_NAMED: (
        *((f"(?i)[- ]{name}[- ]", f"-{number}-") for number, name in enumerate(MONTH_NAMES, start=1)),
        (r"^(\d+)-(\d+)-(\d+) ", r"\3-0\2-0\1 "), *PADDED,
    ),
    COMPACT: ((r"^(\d{4})(\d\d)(\d\d)[T_ -]?(\d\d)(\d\d)(\d\d)", r"\1-\2-\3 \4:\5:\6"),),
    TIME_OF_DAY: ((r"^(\d\d?:)", r"1970-01-01 0\1"), (r" 0(\d\d:)", r" \1")),
}  # fmt: skip
DAY = 86400.0  # [s]


@dataclass(frozen=True)
class Stamps:
    """The format of a column of times, and the zero of its seconds."""

    pattern: re.Pattern[str]
    zoned: bool = False
    zero: int = 0  # [ns] since 1970 of the first cell; midnight for times of day
    has_halves: bool = False  # whether hours are those of half a day, with AM or PM

    @property
    def has_date(self) -> bool:
        """Whether the cells have a date."""
        return self.pattern is not TIME_OF_DAY

    @property
    def first_moment(self) -> str:
        """The first date and time in ISO 8601, in UTC if the cells state a zone."""
        return (datetime(1970, 1, 1) + timedelta(microseconds=self.zero // 1000)).isoformat()

    def seconds(self, cells: "pa.ChunkedArray") -> Array:
        """Convert cells to seconds since zero (N,), NaN where empty; raises pa.ArrowInvalid at another format."""
        text = pc.replace_substring(pc.utf8_trim_whitespace(cells), ",", ".")
        late = np.zeros(len(text))  # [s] of the second half of the day, and of its first hour, which is written 12
        if self.has_halves:
            matches = (pc.match_substring_regex(text, pattern) for pattern in (r"(?i)p\.?m", r"(?:^|[T ])12:"))
            after, noon = (pc.fill_null(match, False) for match in matches)
            late = DAY / 2 * (after.to_numpy().astype(float) - noon.to_numpy())
            text = pc.replace_substring_regex(text, r"(?i)\s*[ap]\.?m\.?$", "")
        for pattern, iso in REWRITTEN[self.pattern]:
            text = pc.replace_substring_regex(text, pattern, iso)
        text = pc.replace_substring_regex(text, r"(\.\d{9})\d+", r"\1")
        moments = pc.cast(text, pa.timestamp("ns", tz="UTC" if self.zoned else None)).cast(pa.int64())
        return np.where(absent(moments), np.nan, (integers(moments) - self.zero) / 1e9 + late)

    def from_first(self, cells: Sequence[str]) -> "Stamps | None":
        """Set the zero of dated stamps to the first dated cell; None if it is not a valid date."""
        if not self.has_date:
            return self
        first = next((cell for cell in cells if self.pattern.fullmatch(cell)), "")
        try:
            seconds = self.seconds(pa.chunked_array([[first]]))
        except pa.ArrowInvalid:
            return None
        return replace(self, zero=round(float(seconds[0]) * 1e6) * 1000)


def stamps_of(cells: Sequence[str], is_text: bool) -> Stamps | None:
    """Find the time format of a column, if most cells have one; any other cell is later an error with its line."""
    filled = [cell for cell in cells if cell]
    patterns = (MOMENT, TIME_OF_DAY, MONTH_NAMED, COMPACT, *_orders(cells)) if is_text else (COMPACT,)
    for pattern in patterns:
        matches = [match for match in map(pattern.fullmatch, filled) if match]
        if matches and len(matches) >= (len(filled) / 2 if is_text else max(len(filled), 2)):
            zones, halves = ({bool(m.groupdict().get(g)) for m in matches} for g in ("zone", "half"))
            same = len(zones) == len(halves) == 1
            return Stamps(pattern, zones == {True}, has_halves=halves == {True}) if same else None
    return None


def _orders(cells: Sequence[str]) -> list[re.Pattern[str]]:
    """The orders of day and month that dates of a column can have; a point is only written after a day."""
    parts = [match.groups() for match in map(DAY_FIRST.fullmatch, cells) if match]
    if any(mark == "." or int(first) > 12 for first, mark, *_ in parts):
        return [DAY_FIRST]
    return [MONTH_FIRST] if any(int(second) > 12 for _, _, second, *_ in parts) else []


def both_dates(cells: Sequence[str]) -> str:
    """Say which two dates a column may hold, where both day and month are at most 12; else ""."""
    dates = [cell for cell in cells if DAY_FIRST.fullmatch(cell)]
    if not dates or _orders(cells):
        return ""
    first, second = re.split("[/-]", dates[0])[:2]
    orders = f"day {first} of month {second}, or day {second} of month {first}"
    return f"holds {dates[0]!r}, which may be {orders}; export dates as in ISO 8601, 2026-10-15 14:02:06"


def is_time(cell: str) -> bool:
    """Whether a cell is a date, a time of day or both."""
    patterns = REWRITTEN if ":" in cell else (COMPACT, DAY_ALONE)
    return cell[:1].isdecimal() and any(pattern.fullmatch(cell) for pattern in patterns)


class Unwrapped:
    """Continues times of day past midnight."""

    def __init__(self) -> None:
        self.last, self.days = np.nan, 0

    def __call__(self, t: Array) -> Array:
        """Add a day to the next times (N,) [s] after each fall of more than half a day."""
        present = np.flatnonzero(np.isfinite(t))
        if not len(present):
            return t
        falls = np.diff(t[present], prepend=t[present[0]] if np.isnan(self.last) else self.last) < -DAY / 2
        days = self.days + np.cumsum(falls)
        self.last, self.days = float(t[present[-1]]), int(days[-1])
        later = t.copy()
        later[present] += DAY * days
        return later
