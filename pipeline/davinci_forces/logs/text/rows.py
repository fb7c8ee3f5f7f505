"""Split the lines of a text log: cells, comments, rulers and numbers, by the marks that give the most numbers."""

import csv
import re
from collections.abc import Sequence

from davinci_forces.logs.log import BadContent, Options
from davinci_forces.logs.text.stamps import is_time

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
NAMED = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " ", "pipe": "|", "\\t": "\t"}
CANDIDATES = ("\t", ";", ",", "|", " ")
COMMA = (
    "the comma may be the delimiter, {}; set `delimiter` or `decimal` for this log in study.toml, or export it with "
    "another delimiter"
)
# what to export instead of a text without columns, by its beginning
EXPORTS = {
    "{": "it looks like JSON: write columns, as pandas' to_csv does",
    "[": "it looks like lists: write columns, as numpy's savetxt does",
    "<": "it looks like XML or HTML: save the table as CSV",
    **dict.fromkeys(("header:", "---", "sec:"), "write columns by `rostopic echo -p`, or record a bag"),
}


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
    readings = f"{digits} with a thousands separator, or {digits[:-3]}.{digits[-3:]}"
    remedy = "export it without thousands separators, or set `decimal` for this log in study.toml"
    return f"may be {readings}; {remedy}"


def find_marks(rows: Sequence[str], body: Sequence[str], options: Options) -> tuple[str, str]:
    """Find the two marks that give the most numbers; raises BadContent if none does, or one has two readings."""
    occurring = [mark for mark in CANDIDATES if mark == "\t" or any(mark in line for line in body)]
    delimiters = [NAMED.get(options.delimiter, options.delimiter)] if options.delimiter else occurring
    decimals = (options.decimal,) if options.decimal else (".", ",")
    cells = {delimiter: [split_cells(line, delimiter) for line in body] for delimiter in delimiters}
    quoted = any('"' in line for line in body)
    scores = {(d, m): _score(cells[d], NUMBERS[m]) for d in delimiters for m in decimals if d != m or quoted}
    best = max(scores, key=lambda marks: scores[marks], default=(",", ","))
    tabs = ("\t", best[1])  # blanks between numbers of cells apart by tabs are thousands separators
    best = tabs if best[0] == " " and "\t" in body[0] and scores.get(tabs, ())[:2] == scores[best][:2] else best
    if not scores or 2 * scores[best][0] < len(body):
        start = rows[0].lstrip()
        hint = next((f"; {hint}" for mark, hint in EXPORTS.items() if start.startswith(mark)), "")
        what = "no delimiter (tab, semicolon, comma, pipe, blanks) splits its lines into columns of numbers"
        remedy = "set `delimiter` and `decimal` for this log in study.toml, or take it out"
        raise BadContent(f"{what}; {remedy}{hint}")
    if best == (",", ".") and not options.delimiter and not options.decimal:
        if scores["\t", "."][:2] == scores[best][:2]:
            raise BadContent(COMMA.format("or separate thousands"))  # for whole lines are numbers as well
        return _comma(rows, body)
    delimiter, mark = best
    marked = [cell for row in cells[delimiter] for cell in row if mark in cell and NUMBERS[mark].fullmatch(cell)]
    if delimiter != "," and not options.decimal and marked and all(map(TWO_READINGS[mark].fullmatch, marked)):
        raise BadContent(f"{marked[0]!r} {both_readings(marked[0])}")
    return best


def _score(body: Sequence[Sequence[str]], number: re.Pattern[str]) -> tuple[int, bool, int]:
    """Count the lines that are mostly numbers; whether they are so throughout; count the numbers in them."""
    counted = [(len(row) - [*map(number.fullmatch, row)].count(None), row) for row in body]
    good = [(count, len([*filter(None, row)])) for count, row in counted if count and _are_mostly(count, row)]
    return len(good), all(count == cells for count, cells in good), sum(count for count, _ in good)


def _are_mostly(count: int, cells: Sequence[str]) -> bool:
    """Whether `count` is most of the cells; cells of times count as empty, because any delimiter keeps them."""
    filled = [cell for cell in cells if cell]
    return 2 * count >= len(filled) or 2 * count >= sum(not is_time(cell) for cell in filled)


def _comma(rows: Sequence[str], body: Sequence[str]) -> tuple[str, str]:
    """Decide whether commas between digits are delimiters, or decimal marks as well.

    Fractions have no sign, and come in pairs with whole parts.  One has a leading zero, or all have one digit more than
    their zeros need, as `%.1f` writes them.
    """
    if "." in "".join(body):
        return ",", "."
    cells = [row for line in body if any(map(NUMBERS["."].fullmatch, row := split_cells(line, ",")))]
    if not all(re.fullmatch(r"[+-]?\d*([eE][+-]?\d+)?", cell) for row in cells for cell in row):
        return ",", "."
    first = split_cells(rows[0], ",")
    if not any(NUMBERS["."].fullmatch(cell) for cell in first):  # a header shows the number of columns
        if len(first) == len(cells[-1]):
            return ",", "."
        if len(first) == 1 and len(cells[-1]) == 2:
            return ";", ","
    widths = {len([cell for cell in row if cell]) for row in cells}
    fractions = [cell for row in cells for cell in row[1::2] if cell]
    pairs = all(width % 2 == 0 for width in widths) and all(cell[0].isdecimal() for cell in fractions)
    lengths = {len(cell) for cell in fractions}
    uneven = len(widths) > 1 or len(lengths) == 1 or any(len(c) > 1 and c[0] == "0" for c in fractions)
    spaced = all(re.search(r",\s", line) and re.search(r",\S", line) for line in body)
    if widths == {2} or (pairs and (uneven or spaced or 2 * len(first) == len(cells[-1]))):
        raise BadContent(COMMA.format("the decimal mark, or both"))
    return ",", "."
