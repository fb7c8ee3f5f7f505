"""Find the delimiter and the decimal mark of a text log from its first rows."""

import re
from collections.abc import Sequence

from davinci_forces.logs.log import BadContent, Options
from davinci_forces.logs.text.rows import NUMBERS, TWO_READINGS, both_readings, split_cells
from davinci_forces.logs.text.stamps import is_time

NAMED = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " ", "pipe": "|", "\\t": "\t"}
CANDIDATES = ("\t", ";", ",", "|", " ")
WHOLE_NUMBER = re.compile(r"[+-]?\d*([eE][+-]?\d+)?")
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
        raise BadContent(
            "no delimiter (tab, semicolon, comma, pipe, blanks) splits its lines into columns of numbers; set "
            f"`delimiter` and `decimal` for this log in study.toml, or take it out{hint}"
        )
    if best == (",", ".") and not options.delimiter and not options.decimal:
        if scores["\t", "."][:2] == scores[best][:2]:
            raise BadContent(COMMA.format("or separate thousands"))  # for whole lines are numbers as well
        return _comma(rows, body)
    if best[0] != "," and not options.decimal:
        _require_decimal_mark(cells[best[0]], best[1])
    return best


def _require_decimal_mark(cells: Sequence[Sequence[str]], mark: str) -> None:
    """Refuse numbers whose marks may all be thousands separators."""
    marked = [cell for row in cells for cell in row if mark in cell and NUMBERS[mark].fullmatch(cell)]
    if marked and all(map(TWO_READINGS[mark].fullmatch, marked)):
        raise BadContent(f"{marked[0]!r} {both_readings(marked[0])}")


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
    if not all(WHOLE_NUMBER.fullmatch(cell) for row in cells for cell in row):
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
    uneven = (
        len(widths) > 1
        or len({len(cell) for cell in fractions}) == 1
        or any(len(c) > 1 and c[0] == "0" for c in fractions)
    )
    spaced = all(re.search(r",\s", line) and re.search(r",\S", line) for line in body)
    if widths == {2} or (pairs and (uneven or spaced or 2 * len(first) == len(cells[-1]))):
        raise BadContent(COMMA.format("the decimal mark, or both"))
    return ",", "."
