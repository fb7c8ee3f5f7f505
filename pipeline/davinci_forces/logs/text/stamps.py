"""Convert dates and times of day in the cells of a text log to seconds: ISO 8601 or HH:MM:SS."""

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
MONTHS = (3, 4, 9, 10, 11)  # in which clocks change in some country, on a Sunday night
HOURS = (1, 2, 3)  # of these changes, in local time
REMARK = (
    "times are local, and between them lies a Sunday night on which clocks may have been put forward or back; if they "
    "were, the times after it are wrong by an hour: record in UTC, or give the data after it as a separate log"
)


@dataclass(frozen=True)
class Stamps:
    """The format of a column of times, and the zero of its seconds."""

    pattern: re.Pattern[str]
    zoned: bool = False
    zero: int = 0  # [ns] since 1970 of the first cell; midnight for times of day

    @property
    def has_date(self) -> bool:
        """Whether the cells have a date."""
        return self.pattern is MOMENT

    @property
    def first_moment(self) -> str:
        """The first date and time in ISO 8601, in UTC if the cells state a zone; "" for times of day."""
        moment = datetime(1970, 1, 1) + timedelta(microseconds=self.zero // 1000)
        return moment.isoformat() if self.has_date else ""

    def seconds(self, cells: "pa.ChunkedArray") -> Array:
        """Convert cells to seconds since zero (N,), NaN where a cell is empty.

        Raises
        ------
        pa.ArrowInvalid
            At a cell of another format.
        """
        text = pc.replace_substring(pc.utf8_trim_whitespace(cells), ",", ".")
        if self.has_date:
            text = pc.replace_substring(pc.replace_substring_regex(text, r"\s+([Z+-])", r"\1"), "/", "-")
        else:
            text = pc.replace_substring_regex(text, r"^(\d\d?:)", r"1970-01-01 0\1")
            text = pc.replace_substring_regex(text, r" 0(\d\d:)", r" \1")
        text = pc.replace_substring_regex(text, r"(\.\d{9})\d+", r"\1")
        moments = pc.cast(text, pa.timestamp("ns", tz="UTC" if self.zoned else None)).cast(pa.int64())
        return np.where(absent(moments), np.nan, (integers(moments) - self.zero) / 1e9)


def stamps_of(cells: Sequence[str]) -> Stamps | None:
    """Find the time format of a text column, if most cells have one; any other cell is later an error with its line."""
    filled = [cell for cell in cells if cell]
    for pattern in (MOMENT, TIME_OF_DAY):
        matches = [match for match in map(pattern.fullmatch, filled) if match]
        if 2 * len(matches) > len(filled):
            zones = {bool(match.groupdict().get("zone")) for match in matches}
            return Stamps(pattern, zoned=zones == {True}) if len(zones) == 1 else None
    return None


def is_time(cell: str) -> bool:
    """Whether a cell is a date, a time of day or both."""
    return cell[:1].isdecimal() and any(pattern.fullmatch(cell) for pattern in (MOMENT, TIME_OF_DAY, DAY_ALONE))


def from_first_cell(stamps: Stamps, cells: Sequence[str]) -> Stamps | None:
    """Set the zero of dated stamps to the first dated cell; None if it is not a valid date."""
    if not stamps.has_date:
        return stamps
    first = next(cell for cell in cells if stamps.pattern.fullmatch(cell))
    try:
        seconds = stamps.seconds(pa.chunked_array([[first]]))
    except pa.ArrowInvalid:
        return None
    return Stamps(stamps.pattern, stamps.zoned, round(float(seconds[0]) * 1e6) * 1000)


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


def clocks_may_change(before: str, after: str) -> bool:
    """Whether clocks may have changed between two local times, in ISO 8601 without a zone."""
    first, last = datetime.fromisoformat(before), datetime.fromisoformat(after)
    sunday = (first - timedelta(days=(first.weekday() + 1) % 7)).replace(hour=0, minute=0, second=0, microsecond=0)
    while sunday <= last:
        changes = (sunday + timedelta(hours=hour) for hour in HOURS if sunday.month in MONTHS)
        if any(first < change <= last for change in changes):
            return True
        sunday += timedelta(days=7)
    return False
