"""Split the lines of a text log: cells, comments, rulers, and numbers with thousands separators."""

import csv
import re

COMMENT = re.compile(r"\s*(?:#|%|//)+\s*")
RULER = re.compile(r"[\s|+:]*[-=*_]{2}[-=*_|+:\s]*")  # between header and rows of a printed table
NO_ROW = re.compile(rb"^[ \t]*(?:#|%|//)[^\n]*|^[ \t|+:]*[-=*_]{2}[-=*_|+: \t]*\r?$", re.MULTILINE)  # either
FRAME = re.compile(r"^[ \t]*\|[ \t]*|[ \t]*\|[ \t]*(?=\r?$)", re.MULTILINE)  # of rows such as `| 0.1 | 2 |`
FRAME_BYTES = re.compile(FRAME.pattern.encode(), re.MULTILINE)
# Thousands: by a blank or an apostrophe in any encoding, or by the mark that the same cell shows not to be decimal.
BLANK = r"(?:[' \xa0\u2009\u202f\u2019\x92]|\xc2\xa0|\xe2\x80[\xaf\x89\x99])"
GROUPED = rf"[1-9]\d{{0,2}}(?:(?:{BLANK}\d{{3}})+(?:DECIMAL\d+)?|(?:GROUP\d{{3}})+DECIMAL\d+|(?:GROUP\d{{3}}){{2,}})"
VALUE = rf"[+-]?(?:(?:\d+(?:DECIMAL\d{{END}})?|DECIMAL\d+)(?:[eE][+-]?\d+)?|nan|inf|infinity|{GROUPED})"
NUMBERS = {
    mark: re.compile(VALUE.replace("DECIMAL", decimal).replace("GROUP", group).replace("{END}", end), re.IGNORECASE)
    for mark, decimal, group, end in ((".", r"\.", ",", "*"), (",", ",", r"\.", "+"))
}
TWO_READINGS = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}{re.escape(mark)}\d{{3}}") for mark in ".,"}


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, without the blanks and quotes around them."""
    cells = line.split() if delimiter == " " else line.split(delimiter)
    if '"' in line:
        try:
            cells = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True), [])
        except csv.Error:  # a cell longer than any number
            return cells
    return [cell.strip() for cell in cells]


def number_in(cell: str, decimal: str) -> float:
    """The number in a cell with or without thousands separators; NaN where there is none."""
    if not NUMBERS[decimal].fullmatch(cell.removesuffix(decimal)):
        return float("nan")
    return float(re.sub(BLANK, "", cell).replace(".,".replace(decimal, ""), "").replace(decimal, "."))


def both_readings(cell: str) -> str:
    """Say which two numbers a cell may be; "" for any other cell."""
    if not any(readings.fullmatch(cell) for readings in TWO_READINGS.values()):
        return ""
    digits = re.sub("[.,]", "", cell)
    return (
        f"may be {digits} with a thousands separator, or {digits[:-3]}.{digits[-3:]}; export it without thousands "
        "separators, or set `decimal` for this log in study.toml"
    )
