"""Times of day and dates in the cells of a text: ISO 8601 or HH:MM:SS, turned into seconds."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from davinci_forces.logs.cells import absent, integers
from davinci_forces.maths.arrays import Array

CLOCK = r"\d?\d:\d\d:\d\d(?:[.,]\d+)?"
DATE = r"\d{4}[-/]\d\d[-/]\d\d"
ZONE = r"\s?(?:Z|[+-]\d\d(?::?\d\d)?)"
MOMENT = re.compile(rf"{DATE}[T ]\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?(?P<zone>{ZONE})?", re.ASCII)
TIME_OF_DAY = re.compile(CLOCK, re.ASCII)
DAY_ALONE = re.compile(DATE, re.ASCII)
DAY = 86400.0  # [s]
MONTHS = (3, 4, 9, 10, 11)  # in which some country's clocks change, on a Sunday night
HOURS = (1, 2, 3)  # at which they do, by local time
REMARK = (
    "times are local and on either side of a Sunday night in which clocks may have been put forward or back; if they "
    "were, the times after it are wrong by an hour: record in UTC, or give what comes after as a log of its own"
)


@dataclass(frozen=True)
class Stamps:
    """How the cells of a column of times are written, and where their seconds are counted from."""

    pattern: re.Pattern[str]
    zoned: bool = False
    zero: int = 0  # [ns] since 1970 of the first cell; of times of day it is midnight

    @property
    def dated(self) -> bool:
        """Whether the cells say the day, too."""
        return self.pattern is MOMENT

    @property
    def started(self) -> str:
        """The first moment in ISO 8601, in UTC where the cells say their zone; "" for times of day."""
        moment = datetime(1970, 1, 1) + timedelta(microseconds=self.zero // 1000)
        return moment.isoformat() if self.dated else ""

    def seconds(self, cells: "pa.ChunkedArray") -> Array:
        """Seconds since zero (N,), NaN where a cell is empty.

        Raises
        ------
        pa.ArrowInvalid
            At a cell that is no such time.
        """
        text = pc.replace_substring(pc.utf8_trim_whitespace(cells), ",", ".")
        if self.dated:
            text = pc.replace_substring(pc.replace_substring_regex(text, r"\s+([Z+-])", r"\1"), "/", "-")
        else:
            text = pc.replace_substring_regex(text, r"^(\d\d?:)", r"1970-01-01 0\1")
            text = pc.replace_substring_regex(text, r" 0(\d\d:)", r" \1")
        text = pc.replace_substring_regex(text, r"(\.\d{9})\d+", r"\1")
        moments = pc.cast(text, pa.timestamp("ns", tz="UTC" if self.zoned else None)).cast(pa.int64())
        return np.where(absent(moments), np.nan, (integers(moments) - self.zero) / 1e9)


def stamps_of(cells: Sequence[str]) -> Stamps | None:
    """How a column of text tells times, if most of its cells do: one that does not is then an error with its line."""
    filled = [cell for cell in cells if cell]
    for pattern in (MOMENT, TIME_OF_DAY):
        matches = [match for match in map(pattern.fullmatch, filled) if match]
        if 2 * len(matches) > len(filled):
            zones = {bool(match.groupdict().get("zone")) for match in matches}
            return Stamps(pattern, zoned=zones == {True}) if len(zones) == 1 else None
    return None


def tells_time(cell: str) -> bool:
    """Whether a cell is a moment, a time of day or a date."""
    return cell[:1].isdecimal() and any(each.fullmatch(cell) for each in (MOMENT, TIME_OF_DAY, DAY_ALONE))


def begun(stamps: Stamps, cells: Sequence[str]) -> Stamps | None:
    """The same, counted from the first cell that says a day; None where no calendar holds it."""
    if not stamps.dated:
        return stamps
    first = next(cell for cell in cells if stamps.pattern.fullmatch(cell))
    try:
        seconds = stamps.seconds(pa.chunked_array([[first]]))
    except pa.ArrowInvalid:
        return None
    return Stamps(stamps.pattern, stamps.zoned, round(float(seconds[0]) * 1e6) * 1000)


class Unwrapped:
    """Times of day that go on past midnight."""

    def __init__(self) -> None:
        self.last, self.days = np.nan, 0

    def __call__(self, t: Array) -> Array:
        """The next times (N,) [s], a day later from where they fall by more than half of one."""
        known = np.flatnonzero(np.isfinite(t))
        if not len(known):
            return t
        falls = np.diff(t[known], prepend=t[known[0]] if np.isnan(self.last) else self.last) < -DAY / 2
        days = self.days + np.cumsum(falls)
        self.last, self.days = float(t[known[-1]]), int(days[-1])
        later = t.copy()
        later[known] += DAY * days
        return later


def clocks_may_change(before: str, after: str) -> bool:
    """Whether clocks may have changed between two moments, in ISO 8601 without a zone."""
    first, last = datetime.fromisoformat(before), datetime.fromisoformat(after)
    sunday = (first - timedelta(days=(first.weekday() + 1) % 7)).replace(hour=0, minute=0, second=0, microsecond=0)
    while sunday <= last:
        changes = (sunday + timedelta(hours=hour) for hour in HOURS if sunday.month in MONTHS)
        if any(first < change <= last for change in changes):
            return True
        sunday += timedelta(days=7)
    return False
