"""Find names and units of the columns of a text log in the lines before its rows."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from davinci_forces.logs.log import Options
from davinci_forces.logs.text.rows import COMMENT, RULER, Unclear, split_cells
from davinci_forces.maths.units import UNSIZED, canonical, measures, split_ratio, unit_in

BRACKETED = re.compile(r"\s*[\[(].*[\])]\s*")
DELIMITERS = (r"\t+", ";", ",", r"\|", r"\s{2,}", r"\s+")  # of a header with another delimiter than the rows
COUNTING = re.compile(r"[+-]?[\d.,]+([eE][+-]?\d+)?")


class Header(NamedTuple):
    """Names and units of all columns, empty where there are none."""

    names: list[str]
    aliases: list[str]  # names as written, where these hold the unit after a slash
    units: list[str]
    preamble: list[str]  # the other lines


def read_header(lines: Sequence[str], columns: Sequence[Sequence[str]], delimiter: str, options: Options) -> Header:
    """Read the lines before the first row; `columns` are the cells of the columns below.

    Raises Unclear if the last line has other columns than the rows, or holds numbers and text.
    """
    width = len(columns)
    rows = [_fitted(line, columns, delimiter) for line in lines]
    fits = [i for i, row in enumerate(rows) if len(row) == width and not RULER.fullmatch(lines[i])]
    remarks = [i for i, line in enumerate(lines) if COMMENT.match(line) or RULER.fullmatch(line)]
    below = [i for i in range((fits or [-1])[-1] + 1, len(rows)) if i not in remarks]
    free = bool(fits) and delimiter == " "  # blanks also separate the words of a remark
    odd = next((rows[i] for i in below if len(rows[i]) > 1 and (not free or _are_units(rows[i]))), None)
    if odd or (below and options.header and not fits):
        raise Unclear(_other_columns(odd or rows[-1], width))
    of_units = next((i for i in fits[::-1] if len(fits) > 1 and _are_units(rows[i])), None)
    above = [i for i in fits if of_units is None or i < of_units] or [i for i in fits if i != of_units]
    distinct = (i for i in above[::-1] if len({*filter(None, rows[i])}) == len([*filter(None, rows[i])]))
    of_names = next(distinct, above[-1] if above else None)  # a row of types repeats itself
    names = [] if of_names is None else rows[of_names]
    if any(COUNTING.fullmatch(cell) for cell in names) and options.header is None:
        raise Unclear(
            f"a line before the rows holds numbers and text ({', '.join(names[:6])}); correct the cell, or set "
            "`header = true` for this log in study.toml if these are names"
        )
    units = [cell.strip("[](){} ") for cell in rows[of_units]] if of_units is not None else [""] * width
    cells_above = zip(units, *(rows[i] for i in above[::-1]), strict=True) if above else ()
    units = [unit or next(filter(None, map(unit_in, cells)), "") for unit, *cells in cells_above] or units
    preamble = [line for i, line in enumerate(lines) if i not in (of_names, of_units)]
    return _split(names or [""] * width, units, preamble)


def _split(names: list[str], units: list[str], preamble: list[str]) -> Header:
    """Take the units out of the names: where one name is a quantity over its unit, all of that form are."""
    ratios = [split_ratio(name) for name in names]
    if any(unit for _, unit in ratios):
        over = (name.partition(" / ") for name in names)
        ratios = [ratio if ratio[1] else (name, unit) for ratio, (name, _, unit) in zip(ratios, over, strict=True)]
    stems = [stem for stem, _ in ratios]
    aliases = [name if name != stem else "" for name, stem in zip(names, stems, strict=True)]
    stated = [unit or ratio[1] for unit, ratio in zip(units, ratios, strict=True)]
    return Header(stems, aliases, stated, preamble)


def _fitted(line: str, columns: Sequence[Sequence[str]], delimiter: str) -> list[str]:
    """Split a line of the header into as many cells as the rows have, if it has them with any delimiter."""
    width = len(columns)
    text = COMMENT.sub("", line, count=1) if COMMENT.match(line) else line
    cells = split_cells(text, delimiter)
    if len(cells) == width + 1 and cells[-1] in ("", "Comment"):
        return cells[:-1]
    if len(cells) == width - 1 and not all(filled := (any(columns[0]), any(columns[-1]))):
        return [*cells, ""] if filled[0] else ["", *cells]  # rows end or begin in a delimiter
    splits = ([cell.strip() for cell in re.split(pattern, text.strip())] for pattern in DELIMITERS)
    fitting = (split for split in splits if len(split) == width > 1 and all(split))
    return cells if '"' in text or (len(cells) == width and delimiter != " ") else next(fitting, cells)


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell]
    sized = [bool(BRACKETED.fullmatch(cell) or measures(canonical(cell))) for cell in filled]
    words = (cell.lower().strip(":").removesuffix("s") for cell in filled)
    known = (word in UNSIZED or word in ("-", "–", "1", "unit", "einheit") for word in words)
    return any(sized) and all(a or b for a, b in zip(sized, known, strict=True))


def _other_columns(cells: Sequence[str], width: int) -> str:
    short = (
        "which one has no name is not known, the first, as a number of the row, or another: name all (in R by "
        "write.csv(..., row.names = FALSE), in pandas by to_csv(index=False))"
    )
    remedy = short if len(cells) == width - 1 else "correct it"
    return (
        f"the header names {len(cells)} columns ({', '.join(cells[:6])}), but rows have {width}; {remedy}, "
        "or set `header = false` for this log in study.toml"
    )
