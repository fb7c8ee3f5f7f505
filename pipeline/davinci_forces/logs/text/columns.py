"""Tell what a column of a text log holds: its kind, the unit of a count since 1970, and why it is not read."""

import re
from collections.abc import Sequence

import numpy as np

from davinci_forces.logs.cells import MISSING
from davinci_forces.logs.text.rows import NUMBERS, both_readings
from davinci_forces.logs.text.stamps import both_dates
from davinci_forces.maths.units import since_1970

DAYS = ((36525, 73051), (730486, 767011))  # of the years 2000 to 2100, as Excel and MATLAB count them
COUNTED_CELLS = 50  # from which a date as a count is recognised
STEP_IN_DAYS = 2e-5  # a shorter sampling time is 1.7 s in days; in seconds, no robot samples so fast
TICKS = ((1.25e17, 1.6e17), (6.3e17, 6.7e17))  # of 100 ns in the same years, as Windows and .NET count them
MEASURED = re.compile(r"[+-]?\d+(?:[.,]\d+)?\s*[^\W\d_°%]+[^\d]*|[+-]?\d+(?:[.,]\d+)?\s*[°%]")


def kind_of(cells: Sequence[str], number: re.Pattern[str]) -> str:
    """The kind of a column: text if it has cells and none of them is a number."""
    filled = [cell for cell in cells if cell and cell not in MISSING]
    return "text" if filled and not any(map(number.fullmatch, filled)) else "number"


def counted_unit(cells: Sequence[str]) -> str:
    """The unit of a column that counts since 1970 or an earlier day, if its numbers say so; else ""."""
    try:
        x = np.array([float(cell.replace(",", ".")) for cell in cells[:COUNTED_CELLS] if cell not in MISSING])
    except ValueError:
        return ""
    if not len(x):
        return ""
    low, high = float(x.min()), float(x.max())
    if (unit := since_1970(low)) not in ("", "s") and unit == since_1970(high):
        return unit
    if any(first < low and high < last for first, last in TICKS):
        return "100 ns"
    if len(x) < 3 or not any(first < low and high < last for first, last in DAYS):
        return ""
    steps = np.diff(x)
    return "day" if np.all((steps > 0) & (steps < STEP_IN_DAYS)) else ""


def why_text(cells: Sequence[str]) -> str:
    """Why a column of text is read neither as numbers nor as times, and what to export; "" for plain text."""
    cell = next(cell for cell in cells if cell and cell not in MISSING)
    if readings := both_dates(cells):
        return readings
    if readings := both_readings(cell):
        return f"holds {cell!r}, which {readings}"
    if any(number.fullmatch(cell) for number in NUMBERS.values()):
        return f"holds {cell!r}, with another decimal mark than other columns; export all with one mark"
    if re.search(r"\d:\d|\d[-./ ]\w+[-./ ]\d", cell):
        return f"holds times such as {cell!r}, in a format that is not read; export seconds, or ISO 8601"
    if MEASURED.fullmatch(cell):
        return f"holds {cell!r}, a number and its unit in one cell; export the numbers alone"
    return ""
