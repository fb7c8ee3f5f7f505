"""Detect the format of a text log from its first lines and the options: its rows, and names and units above them."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from davinci_forces.logs.cells import MISSING
from davinci_forces.logs.log import BadContent, Channel, Options, unique
from davinci_forces.logs.text.rows import COMMENT, FRAME, NUMBERS, RULER, both_readings, find_marks, split_cells
from davinci_forces.logs.text.stamps import Stamps, both_dates, stamps_of
from davinci_forces.maths.units import UNSIZED, canonical, measures, since_1970, split_ratio, unit_in

SAMPLE_LINES = 1000  # lines from which the format is found
ABSENT = MISSING | {""}
MAX_FOLDED = 4  # lines of a quoted name
SEPARATOR_LINE = re.compile(r'"?sep=(.)"?\s*')  # the first line of files for Excel
DAYS = ((36525, 73051), (730486, 767011))  # of the years 2000 to 2100, as Excel and MATLAB count them
COUNTED_CELLS = 50  # from which a date as a count is recognised
STEP_IN_DAYS = 2e-5  # a shorter sampling time is 1.7 s in days; in seconds, no robot samples so fast
TICKS = ((1.25e17, 1.6e17), (6.3e17, 6.7e17))  # of 100 ns in the same years, as Windows and .NET count them
MEASURED = re.compile(r"[+-]?\d+(?:[.,]\d+)?\s*[^\W\d_°%]+[^\d]*|[+-]?\d+(?:[.,]\d+)?\s*[°%]")
BRACKETED = re.compile(r"\s*[\[(].*[\])]\s*")
DELIMITERS = (r"\t+", ";", ",", r"\|", r"\s{2,}", r"\s+")  # of a header with another delimiter than the rows
COUNTING = re.compile(r"[+-]?[\d.,]+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Dialect:
    """The format of the rows of a text log."""

    delimiter: str  # " " stands for any run of blanks
    decimal: str
    channels: tuple[Channel, ...]  # of every column of a row; "text" is the kind of columns without any number
    stamps: dict[int, Stamps]  # of the columns of times
    header: int  # lines before the first row
    names: tuple[str, ...]  # as the file has them; empty if it does not name the columns
    header_lines: frozenset[str]  # all of its lines
    preamble: tuple[str, ...]  # those without names and units
    quoted: bool  # whether cells are quoted
    framed: bool  # whether rows begin or end with a pipe
    marked: bool  # whether rows begin with the mark of a comment
    unread: dict[str, str]  # by channel of text, why it is read neither as numbers nor as times
    remarks: tuple[str, ...]  # on changed names and unread columns

    @property
    def has_trailing(self) -> bool:
        """Whether every row ends in a delimiter."""
        return len(self.names) > 1 and not self.names[-1]


def find_dialect(lines: Sequence[str], options: Options) -> Dialect:
    """Find the format of a file from its first lines; raises BadContent if marks or columns have two readings."""
    lines = _unfolded(lines[:SAMPLE_LINES])
    if lines and (separator := SEPARATOR_LINE.fullmatch(lines[0])):
        options, lines = replace(options, delimiter=options.delimiter or separator[1]), ["", *lines[1:]]
    rows = [line for line in lines if line.strip()]
    if not rows:
        raise BadContent("it holds no rows; record it again, or take it out of study.toml")
    body = _body(rows)
    delimiter, decimal = find_marks(rows, body, options)
    framed = delimiter == "|" and any(map(FRAME.search, body))
    if framed:
        lines, body = [FRAME.sub("", line) for line in lines], [FRAME.sub("", line) for line in body]
    columns = _columns(body, delimiter)
    kinds = [_kind_of(column, NUMBERS[decimal]) for column in columns]
    stamps = {i: s for i, column in enumerate(columns) if (s := stamps_of(column, kinds[i] == "text"))}
    first = _first_row(lines, delimiter, kinds, NUMBERS[decimal], stamps, options)
    if options.header is None and _are_numbers_of_columns(split_cells(lines[first], delimiter), columns, decimal):
        first, options = first + 1, replace(options, header=True)
    above = [line for line in lines[:first] if line.strip()]
    names, aliases, stated, preamble = read_header(above, columns, delimiter, options)
    whole = [row for line in lines[first:] if len(row := split_cells(line, delimiter)) == len(kinds)]
    from_first = {i: stamp.from_first([row[i] for row in whole]) for i, stamp in stamps.items()}
    stamps = {i: stamp for i, stamp in from_first.items() if stamp}  # a column without a valid first date is text
    kinds = ["time" if i in stamps else kind for i, kind in enumerate(kinds)]
    described = zip(unique(names), stated, columns, kinds, _aliases(names, aliases, columns), strict=True)
    channels = tuple(
        Channel(name, unit or (_counted_unit(column) if kind == "number" else ""), kind, alias=alias)
        for name, unit, column, kind, alias in described
    )
    renamed = (
        f"more than one column is called {written!r}; column {i} is read as {channel.name!r}"
        for i, (written, channel) in enumerate(zip(names, channels, strict=True))
        if written and written != channel.name
    )
    unread = {
        channel.name: f"column {i} ({channel.name}) {why}"
        for i, channel in enumerate(channels)
        if channel.kind == "text" and (why := _why_text(columns[i]))
    }
    return Dialect(
        delimiter=delimiter, decimal=decimal, channels=channels, stamps=stamps, header=first,
        header_lines=frozenset(line.strip() for line in above),
        names=tuple(names) if any(names) else (), preamble=tuple(preamble), framed=framed,
        quoted=any('"' in row for row in body), marked=bool(COMMENT.match(body[0])),
        unread=unread, remarks=(*renamed, *unread.values()),
    )  # fmt: skip


def _aliases(names: Sequence[str], written: Sequence[str], columns: Sequence[Sequence[str]]) -> Iterator[str]:
    """Aliases, with the joint that another column names, as `rostopic echo -p` does: name0 holds that of position0."""
    matches = [re.fullmatch(r"(|.*[./])(name|position|velocity|effort)(\d+)", name) for name in names]
    joints = {(m[1], m[3]): cells[0] for m, cells in zip(matches, columns, strict=True)
              if m and m[2] == "name" and len({*cells}) == 1}  # fmt: skip
    for m, alias in zip(matches, written, strict=True):
        joint = joints.get((m[1], m[3]), "") if m and m[2] != "name" else ""
        yield f"{m[1]}{m[2]}[{joint}]" if m and joint else alias


def _unfolded(lines: Sequence[str]) -> list[str]:
    """Join the lines of quoted names that span several; the number of lines stays."""
    unfolded = [*lines]
    for i, line in enumerate(unfolded):
        for n in range(2, MAX_FOLDED + 1) if line.count('"') % 2 else ():
            joined = " ".join(unfolded[i : i + n])
            if joined.count('"') % 2 == 0:
                unfolded[i : i + n] = [""] * (n - 1) + [joined]
                break
    return unfolded


def _body(rows: Sequence[str]) -> list[str]:
    """The last three quarters of the lines, without comments and rulers unless there is nothing else."""
    body = rows[len(rows) // 4 :]
    return [line for line in body if not (COMMENT.match(line) or RULER.fullmatch(line))] or [*body]


def _columns(body: list[str], delimiter: str) -> list[tuple[str, ...]]:
    """The cells of every column in the rows of the most frequent width; other rows leave `body`."""
    rows = [split_cells(line, delimiter) for line in body]
    width = Counter(map(len, rows)).most_common(1)[0][0]
    body[:] = [line for line, row in zip(body, rows, strict=True) if len(row) == width]
    return [*zip(*(row for row in rows if len(row) == width), strict=True)]


def _first_row(
    lines: Sequence[str], delimiter: str, kinds: Sequence[str], number: re.Pattern[str], stamps: dict[int, Stamps],
    options: Options,
) -> int:  # fmt: skip
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if options.header is not None:
        return filled[0] + options.header
    for i in filled:
        cells = split_cells(lines[i], delimiter)
        measured = [cell for cell, kind in zip(cells, kinds, strict=False) if kind == "number" and cell not in ABSENT]
        dated = all(cells[column][:1].isdecimal() for column in stamps if column < len(cells) and cells[column])
        if len(cells) == len(kinds) and dated and (measured or stamps) and all(map(number.fullmatch, measured)):
            return i
    raise BadContent("none of its lines is a row of numbers; set `delimiter` and `decimal` for this log in study.toml")


def _are_numbers_of_columns(cells: Sequence[str], columns: Sequence[Sequence[str]], decimal: str) -> bool:
    """Whether a line only numbers at least three columns, as pandas does those without names, above fractions."""
    numbers = [cell for cell in cells if cell]
    counts = any(numbers == [str(i + first) for i in range(len(numbers))] for first in (0, 1))
    return counts and len(numbers) > 2 and any(all(decimal in cell for cell in column) for column in columns)


def _kind_of(cells: Sequence[str], number: re.Pattern[str]) -> str:
    filled = [cell for cell in cells if cell and cell not in MISSING]
    return "text" if filled and not any(map(number.fullmatch, filled)) else "number"


def _counted_unit(cells: Sequence[str]) -> str:
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


def _why_text(cells: Sequence[str]) -> str:
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


def read_header(
    lines: Sequence[str], columns: Sequence[Sequence[str]], delimiter: str, options: Options
) -> tuple[list[str], list[str], list[str], list[str]]:
    """Read names, aliases and units, "" where there are none, from the lines above `columns`, and the other lines.

    An alias is a name as it is written, where that holds the unit after a slash.
    Raises BadContent if the last line has other columns, or numbers and text.
    """
    width = len(columns)
    rows = [_fitted(line, columns, delimiter) for line in lines]
    fits = [i for i, row in enumerate(rows) if len(row) == width and not RULER.fullmatch(lines[i])]
    remarks = [i for i, line in enumerate(lines) if COMMENT.match(line) or RULER.fullmatch(line)]
    below = [i for i in range((fits or [-1])[-1] + 1, len(rows)) if i not in remarks]
    free = bool(fits) and delimiter == " "  # blanks also separate the words of a remark
    odd = next((rows[i] for i in below if len(rows[i]) > 1 and (not free or _are_units(rows[i]))), None)
    if odd or (below and options.header and not fits):
        raise BadContent(_other_columns(odd or rows[-1], width))
    of_units = next((i for i in fits[::-1] if len(fits) > 1 and _are_units(rows[i])), None)
    above = [i for i in fits if of_units is None or i < of_units] or [i for i in fits if i != of_units]
    distinct = (i for i in above[::-1] if len({*filter(None, rows[i])}) == len([*filter(None, rows[i])]))
    of_names = next(distinct, above[-1] if above else None)  # a row of types repeats itself
    names = [] if of_names is None else rows[of_names]
    if any(COUNTING.fullmatch(cell) for cell in names) and options.header is None:
        what = f"a line before the rows holds numbers and text ({', '.join(names[:6])})"
        remedy = "correct the cell, or set `header = true` for this log in study.toml if these are names"
        raise BadContent(f"{what}; {remedy}")
    units = [cell.strip("[](){} ") for cell in rows[of_units]] if of_units is not None else [""] * width
    cells_above = zip(units, *(rows[i] for i in above[::-1]), strict=True) if above else ()
    units = [unit or next(filter(None, map(unit_in, cells)), "") for unit, *cells in cells_above] or units
    preamble = [line for i, line in enumerate(lines) if i not in (of_names, of_units)]
    names = names or [""] * width
    ratios = [split_ratio(name) for name in names]
    if any(unit for _, unit in ratios):  # where one name is a quantity over its unit, all of that form are
        over = (name.partition(" / ") for name in names)
        ratios = [ratio if ratio[1] else (name, unit) for ratio, (name, _, unit) in zip(ratios, over, strict=True)]
    stems = [stem for stem, _ in ratios]
    aliases = [name if name != stem else "" for name, stem in zip(names, stems, strict=True)]
    stated = [unit or ratio[1] for unit, ratio in zip(units, ratios, strict=True)]
    return stems, aliases, stated, preamble


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
    doubt = "which one has no name is not known, the first, as a number of the row, or another"
    names = "name all (in R by write.csv(..., row.names = FALSE), in pandas by to_csv(index=False))"
    remedy = f"{doubt}: {names}" if len(cells) == width - 1 else "correct it"
    counts = f"the header names {len(cells)} columns ({', '.join(cells[:6])}), but rows have {width}"
    return f"{counts}; {remedy}, or set `header = false` for this log in study.toml"
