"""Parse the two headers of a LabVIEW measurement file: of the file, and of each file segment."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from functools import lru_cache

from davinci_forces.logs.lines import decode
from davinci_forces.logs.log import BadContent, unique
from davinci_forces.logs.timeline import Sampling

MAGIC = b"LabVIEW Measurement"
END = b"***End_of_Header***"
X = "X_Value"
SEPARATOR = re.compile(rb"Separator(.)(.*)", re.DOTALL)
DATE_CELL = re.compile(r"(\d{4})/(\d\d?)/(\d\d?)")
TIME_CELL = re.compile(r"(\d\d?):(\d\d):(\d\d)(?:[.,](\d+))?")
FOR_PEOPLE = ("Operator", "Project", "Description", "Writer_Version", "Time_Pref")


@dataclass(frozen=True)
class FileHeader:
    """The header of a file; it is repeated where a later session appended to the file."""

    separator: bytes = b"\t"
    decimal: str = ""
    x_columns: str = "One"  # "No", "One" or "Multi"
    several: bool = False  # every write is a file segment with a header
    tags: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Layout:
    """The columns of the rows of a file segment.  Column 0 is x, or empty without an x."""

    file: FileHeader
    names: tuple[str, ...]  # of every column of a row, unique; "" for an empty one
    units: tuple[str, ...]  # of every column
    line: int  # of the column line
    samples: int | None = None  # per channel, as the header says
    start: Decimal | None = None  # [s] of the first sample, since the year 1 in local time
    started: str = ""
    x0: float = 0.0
    step: float | None = None
    step_written: str = ""
    sampling: dict[str, Sampling] = field(default_factory=dict)  # of the channels with samples
    remarks: tuple[str, ...] = ()  # what is wrong in the header, and what was done

    @property
    def width(self) -> int:
        """Number of cells of a row without a comment."""
        return len(self.names)

    @property
    def first_channel(self) -> str:
        """The first channel, whose x stands in column 0; "" where there is none."""
        return next(iter(self.sampling), "")

    @property
    def first_sampling(self) -> Sampling:
        """The sampling of the first channel as the header states it."""
        return self.sampling.get(self.first_channel) or Sampling(self.start, self.x0, self.step or 0.0)

    def is_like(self, layout: "Layout") -> bool:
        """Whether the rows of both have the same columns."""
        mine, theirs = self.file, layout.file
        return (self.names, mine.separator, mine.x_columns) == (layout.names, theirs.separator, theirs.x_columns)


def file_header(lines: Sequence[bytes], encoding: str | None) -> FileHeader:
    """Parse the header of a file, from its first line; raises BadContent for an impossible mark or X_Columns."""
    tag = next(filter(None, map(SEPARATOR.fullmatch, lines[1:])), None)
    in_first_line = lines[0][len(MAGIC) : len(MAGIC) + 1].strip(b" ") or b"\t"
    separator = {b"Tab": b"\t", b"Comma": b","}.get(tag[2].strip(), tag[1]) if tag else in_first_line
    if not separator.isascii() or separator.isalnum() or separator in b"+-*":
        mark = decode(separator, encoding)
        raise BadContent(f"the separator is {mark!r}, which cannot separate numbers; export with tabs")
    cells = [decode(line, encoding).split(separator.decode()) for line in lines[1:]]
    tags = {row[0].strip(): row[1].strip() for row in cells if len(row) > 1 and row[0].strip() not in ("", "Separator")}
    decimal = tags.get("Decimal_Separator", "")
    if not decimal and any(line.startswith(b"Decimal_Separator" + separator * 2) for line in lines):
        decimal = separator.decode()
    if decimal == separator.decode():
        raise BadContent(f"the separator and the decimal mark are both {decimal!r}; export the log again with another")
    x_columns = tags.get("X_Columns", "One").capitalize()
    if x_columns not in ("No", "One", "Multi"):
        raise BadContent(f"X_Columns is {x_columns!r}, where LabVIEW writes No, One or Multi")
    several = tags.get("Multi_Headings", "No").lower() == "yes"
    return FileHeader(separator, decimal, x_columns, several, tags)


def layout(lines: Sequence[bytes], columns: bytes, file: FileHeader, line: int, encoding: str | None) -> Layout:
    """Parse the header and the column line of a file segment; raises BadContent without names, or if x is no time."""
    separator = file.separator.decode()
    rows = [decode(text, encoding).split(separator) for text in lines]
    tags = {row[0].strip(): [cell.strip() for cell in row[1:]] for row in rows if row[0].strip()}
    names, remarks = _names(decode(columns, encoding).split(separator), file, line)
    measured = [i for i in range(len(names)) if names[i] and not _is_x(i, file)]
    dimension, stated = _first(tags, "X_Dimension") or "Time", _first(tags, "Channels")
    if dimension != "Time":
        raise BadContent(f"the x axis is {dimension}, not time; this is not a recording over time: choose another file")
    if stated.isdecimal() and int(stated) != len(measured):
        what = f"the header states {stated} channels, but the column line names {len(measured)}; those are read"
        remarks.append(f"line {line}: {what}")
    x_unit = _first(tags, "X_Unit_Label") or "s"
    unit_of = (x_unit if _is_x(i, file) else _cell(tags, "Y_Unit_Label", i) for i in range(len(names)))
    units = [unit if name else "" for name, unit in zip(names, unit_of, strict=True)]
    samples = [int(cell) for cell in tags.get("Samples", []) if cell.isdecimal()]
    start, started = _start(_first(tags, "Date"), _first(tags, "Time"))
    if not started:
        start, started = _start(file.tags.get("Date", ""), file.tags.get("Time", ""))
    sampled = [i for i in measured if _cell(tags, "Samples", i) != "0"]  # without samples the other cells mean nothing
    written = _first(tags, "Delta_X")
    return Layout(
        file=file, names=tuple(names), units=tuple(units), line=line, samples=max(samples, default=None),
        start=start, started=started, x0=_number(_first(tags, "X0")) or 0.0, step=_number(written),
        step_written=written, sampling={names[i]: _sampling(tags, i, start) for i in sampled}, remarks=tuple(remarks),
    )  # fmt: skip


def _sampling(tags: dict[str, list[str]], column: int, start: Decimal | None) -> Sampling:
    """Parse the sampling of a column; a missing cell has the value of the first one."""
    own_start, _ = _start(_cell(tags, "Date", column), _cell(tags, "Time", column))
    x0, step = (_number(_cell(tags, tag, column) or _first(tags, tag)) or 0.0 for tag in ("X0", "Delta_X"))
    return Sampling(start if own_start is None else own_start, x0, step)


def _cell(tags: dict[str, list[str]], tag: str, column: int) -> str:
    cells = tags.get(tag, [])
    return cells[column - 1] if 0 < column <= len(cells) else ""


def unescape(comment: bytes, encoding: str | None) -> str:
    r"""Restore a comment as it was typed: LabVIEW writes `\\` for a backslash and `\0A` for a control character."""
    escape = re.compile(r"\\(\\|[0-9A-Fa-f]{2})")
    return escape.sub(lambda m: "\\" if m[1] == "\\" else chr(int(m[1], 16)), decode(comment, encoding)).strip()


def _is_x(column: int, file: FileHeader) -> bool:
    return column % 2 == 0 if file.x_columns == "Multi" else column == 0


def _names(cells: list[str], file: FileHeader, line: int) -> tuple[list[str], list[str]]:
    """Parse the names of the columns of a row; returns remarks on changed names, too."""
    cells = [cell.strip() for cell in cells]
    while cells and not cells[-1]:
        cells.pop()
    if cells and cells[-1] == "Comment":
        cells.pop()
    if not cells or (cells[0] != X and any(_number(cell) is not None for cell in cells)):
        raise BadContent(f"the column line, which names the channels and begins with {X}, is missing")
    names = list(unique([X if _is_x(i, file) else cell for i, cell in enumerate(cells)]))
    remarks = [
        f"line {line}: channel {i} has no name, or that of another ({cell!r}); it is read as {name!r}"
        for i, (cell, name) in enumerate(zip(cells, names, strict=True))
        if name != cell and not _is_x(i, file)
    ]
    if file.x_columns == "No":
        names[0] = ""
    return names, remarks


def _first(tags: dict[str, list[str]], tag: str) -> str:
    return next((cell for cell in tags.get(tag, []) if cell), "")


def _number(cell: str) -> float | None:
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return None


@lru_cache  # all columns of a header have the same, as a rule
def _start(date: str, time: str) -> tuple[Decimal | None, str]:
    """Parse a start to seconds since the year 1, exact to the last written digit, and to ISO 8601 without a zone."""
    day, clock = DATE_CELL.fullmatch(date), TIME_CELL.fullmatch(time)
    if not day or not clock:
        return None, ""
    try:
        moment = datetime(*(int(part) for part in day.groups()), *(int(part) for part in clock.groups()[:3]))  # type: ignore
    except ValueError:
        return None, ""
    seconds = moment.toordinal() * 86400 + moment.hour * 3600 + moment.minute * 60 + moment.second
    fraction = clock[4] or "0"
    return Decimal(seconds) + Decimal(f"0.{fraction}"), f"{moment.isoformat()}.{fraction[:6].ljust(6, '0')}"
