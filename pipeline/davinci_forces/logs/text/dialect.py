"""Detect the format of a text log from its first lines and the options: delimiter, decimal mark, header."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from davinci_forces.logs.log import Options, renaming_remarks, unique, unit_in
from davinci_forces.logs.text.stamps import Stamps, from_first_cell, is_time, stamps_of
from davinci_forces.maths.units import canonical, measures

NAMED = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " ", "\\t": "\t"}
NAMES = {delimiter: name for name, delimiter in NAMED.items() if name != "\\t"}
VALUE = r"[+-]?((\d+MARK\d+|MARK?\d+END)([eE][+-]?\d+)?|nan|inf|infinity)"
NUMBER_PATTERNS = {
    ".": re.compile(VALUE.replace("MARK", r"\.").replace("END", r"\.?"), re.IGNORECASE),
    ",": re.compile(VALUE.replace("MARK", ",").replace("END", ""), re.IGNORECASE),
}
WHOLE_NUMBER = re.compile(r"[+-]?\d*([eE][+-]?\d+)?")
SAMPLE_LINES = 1000  # lines from which the format is found
CANDIDATES = ("\t", ";", ",", " ")
UNIT_CELL = re.compile(r"\s*[\[(].*[\])]\s*")


class Unclear(ValueError):
    """The format is ambiguous or unknown; the message says which option to set."""


@dataclass(frozen=True)
class Dialect:
    """The format of the rows of a text log."""

    delimiter: str  # " " stands for any run of blanks
    decimal: str
    names: tuple[str, ...]  # of every column of a row
    units: tuple[str, ...]
    kinds: tuple[str, ...]  # "number", "time", or "text" for columns without any number
    stamps: dict[int, Stamps]  # of the columns of times
    header: int  # lines before the first row
    named: bool  # whether the file names the columns
    preamble: tuple[str, ...]  # lines of the header without names and units
    trailing: bool  # whether every row ends in a delimiter
    quoted: bool  # whether cells are quoted
    remarks: tuple[str, ...] = ()  # on names that had to be changed


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, without the blanks and quotes around them."""
    if delimiter == " ":
        return line.split()
    cells = next(csv.reader([line], delimiter=delimiter), []) if '"' in line else line.split(delimiter)
    return [cell.strip() for cell in cells]


def find_dialect(lines: Sequence[str], options: Options) -> Dialect:
    """Find the format of the first lines of a file.

    Raises
    ------
    Unclear
        If no delimiter makes columns of numbers, the comma may be both delimiter and decimal mark, or the header has
        other columns than the rows.
    """
    lines = lines[:SAMPLE_LINES]
    rows = [line for line in lines if line.strip()]
    if not rows:
        raise Unclear("it holds no rows; record it again, or take it out of study.toml")
    delimiter, decimal = _marks(rows, options)
    body = [split_cells(line, delimiter) for line in rows[len(rows) // 4 :]]
    width = Counter(len(cells) for cells in body).most_common(1)[0][0]
    whole = [cells for cells in body if len(cells) == width]
    kinds = _kinds(whole, NUMBER_PATTERNS[decimal])
    header = _header(lines, delimiter, kinds, NUMBER_PATTERNS[decimal], options)
    names, units, preamble = _names([line for line in lines[:header] if line.strip()], delimiter, width, options)
    stamps = (
        _stamps([split_cells(line, delimiter) for line in lines[header:] if line.strip()], kinds)
        if "text" in kinds
        else {}
    )
    kinds = ["time" if i in stamps else kind for i, kind in enumerate(kinds)]
    names, units = names or [""] * width, units or [""] * width
    return Dialect(
        delimiter=delimiter, decimal=decimal, names=unique(names), named=any(names),
        units=tuple(unit or unit_in(name) for name, unit in zip(names, units, strict=True)), kinds=tuple(kinds),
        stamps=stamps, header=header, preamble=tuple(preamble), trailing=width > 1 and any(names) and not names[-1],
        quoted=any('"' in row for row in rows[len(rows) // 4 :]), remarks=tuple(renaming_remarks(names, unique(names))),
    )  # fmt: skip


def _marks(rows: Sequence[str], options: Options) -> tuple[str, str]:
    """Find the delimiter and decimal mark that give the most numbers."""
    delimiters = (NAMED.get(options.delimiter, options.delimiter),) if options.delimiter else CANDIDATES
    decimals = (options.decimal,) if options.decimal else (".", ",")
    body = rows[len(rows) // 4 :]
    cells = {delimiter: [split_cells(line, delimiter) for line in body] for delimiter in delimiters}
    scores = {(d, m): _score(cells[d], NUMBER_PATTERNS[m]) for d in delimiters for m in decimals if d != m}
    best = max(scores, key=lambda marks: scores[marks], default=(",", ","))
    if not scores or 2 * scores[best][0] < len(body):
        raise Unclear(
            "no delimiter (tab, semicolon, comma, blanks) splits its lines into columns of numbers; set `delimiter` "
            "and `decimal` for this log in study.toml, or take it out"
        )
    if best == (",", ".") and not options.delimiter and not options.decimal:
        return _comma(rows, body)
    return best


def _score(body: Sequence[Sequence[str]], number: re.Pattern[str]) -> tuple[int, int]:
    """Count the lines that are mostly numbers, and the numbers in them."""
    numbers = [len(cells) - [*map(number.fullmatch, cells)].count(None) for cells in body]
    good = [count for count, cells in zip(numbers, body, strict=True) if count and _are_mostly(count, cells)]
    return len(good), sum(good)


def _are_mostly(count: int, cells: Sequence[str]) -> bool:
    """Whether `count` is most of the cells; cells of times count as empty, because any delimiter keeps them."""
    filled = [cell for cell in cells if cell]
    return 2 * count >= len(filled) or 2 * count >= sum(not is_time(cell) for cell in filled)


def _comma(rows: Sequence[str], body: Sequence[str]) -> tuple[str, str]:
    """Decide whether commas between digits are delimiters, or decimal marks as well.

    Fractions have no sign, one has a leading zero, and they come in pairs with whole parts.
    """
    if "." in "".join(body):
        return ",", "."
    cells = [row for line in body if any(map(NUMBER_PATTERNS["."].fullmatch, row := split_cells(line, ",")))]
    if not all(WHOLE_NUMBER.fullmatch(cell) for row in cells for cell in row):
        return ",", "."
    first = split_cells(rows[0], ",")
    if not any(NUMBER_PATTERNS["."].fullmatch(cell) for cell in first):  # a header shows the number of columns
        if len(first) == len(cells[-1]):
            return ",", "."
        if len(first) == 1 and len(cells[-1]) == 2:
            return ";", ","
    widths = {len([cell for cell in row if cell]) for row in cells}
    fractions = [cell for row in cells for cell in row[1::2] if cell]
    pairs = all(width % 2 == 0 for width in widths) and all(cell[0].isdecimal() for cell in fractions)
    if widths == {2} or (pairs and (len(widths) > 1 or any(len(c) > 1 and c[0] == "0" for c in fractions))):
        raise Unclear(
            "the comma may be the delimiter, the decimal mark, or both; set `delimiter` or `decimal` for this log in "
            "study.toml, or export it with another delimiter"
        )
    return ",", "."


def _kinds(body: Sequence[Sequence[str]], number: re.Pattern[str]) -> list[str]:
    """Find the kind of each column: text if it has cells and none of them is a number."""
    kinds = []
    for column in zip(*body, strict=True):
        filled = [cell for cell in column if cell]
        kinds.append("text" if filled and not any(number.fullmatch(cell) for cell in filled) else "number")
    return kinds


def _stamps(rows: Sequence[Sequence[str]], kinds: Sequence[str]) -> dict[int, Stamps]:
    """Find the time columns among those of text."""
    rows = [row for row in rows if len(row) == len(kinds)]
    columns = {i: [row[i] for row in rows] for i, kind in enumerate(kinds) if kind == "text"}
    by_column = {i: (s := stamps_of(cells)) and from_first_cell(s, cells) for i, cells in columns.items()}
    return {i: stamps for i, stamps in by_column.items() if stamps}


def _header(
    lines: Sequence[str], delimiter: str, kinds: Sequence[str], number: re.Pattern[str], options: Options
) -> int:
    """Count the lines before the first row."""
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if options.header is not None:
        return filled[0] + options.header
    for i in filled:
        cells = split_cells(lines[i], delimiter)
        measured = [cell for cell, kind in zip(cells, kinds, strict=False) if kind == "number" and cell]
        if len(cells) == len(kinds) and measured and all(number.fullmatch(cell) for cell in measured):
            return i
    raise Unclear("none of its lines is a row of numbers; set `delimiter` and `decimal` for this log in study.toml")


def _names(
    header: Sequence[str], delimiter: str, width: int, options: Options
) -> tuple[list[str], list[str], list[str]]:
    """Find names and units in the lines before the first row; returns the other lines, too."""
    rows = [split_cells(line.lstrip("#% ") if line.lstrip()[:1] in "#%" else line, delimiter) for line in header]
    rows = [[*row, ""] if len(row) == width - 1 else row for row in rows]
    rows = [row[:-1] if len(row) == width + 1 and row[-1] in ("", "Comment") else row for row in rows]
    fits = [i for i, row in enumerate(rows) if len(row) == width]
    units: list[str] = []
    if len(fits) > 1 and _are_units(rows[fits[-1]]):
        units = [cell.strip("[]() ") for cell in rows[fits.pop()]]
    names = rows[fits[-1]] if fits else []
    if header and not fits and (len(rows[-1]) > 1 or options.header) and header[-1].lstrip()[:1] not in "#%":
        raise Unclear(
            f"the header names {len(rows[-1])} columns ({', '.join(rows[-1][:6])}), but rows have {width}; correct "
            "it, or set `header = false` for this log in study.toml"
        )
    if any(NUMBER_PATTERNS["."].fullmatch(cell) for cell in names) and options.header is None:
        raise Unclear(
            f"a line before the rows holds numbers and text ({', '.join(names[:6])}); correct the cell, or set "
            "`header = true` for this log in study.toml if these are names"
        )
    used = (*fits[-1:], *(i for i, row in enumerate(rows) if units and [c.strip("[]() ") for c in row] == units))
    return names, units, [line for i, line in enumerate(header) if i not in used]


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return bool(filled) and all(UNIT_CELL.fullmatch(cell) or measures(canonical(cell)) for cell in filled)
