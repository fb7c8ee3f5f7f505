"""Columns of numbers in text, with or without a header, with any delimiter and decimal mark."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa

from davinci_forces.errors import BadLog
from davinci_forces.logs.cells import MISSING, UNREADABLE, Cells, parse
from davinci_forces.logs.lines import GZIP, Lines, decode
from davinci_forces.logs.log import BadContent, Block, Log, Options, read_ahead
from davinci_forces.logs.text.dialect import ABSENT, Dialect, find_dialect
from davinci_forces.logs.text.rows import FRAME_BYTES, NAMED, NO_ROW, NUMBERS, both_readings, number_in, split_cells
from davinci_forces.logs.text.stamps import Unwrapped
from davinci_forces.maths.arrays import Array

NAMES = {delimiter: name for name, delimiter in NAMED.items() if name != "\\t"}
MAX_LISTED_LINES = 100  # lines between rows that are shown


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file may be text: it holds no control characters, or it is zipped."""
    wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    return head.startswith(GZIP) or wide or not re.search(rb"[\x00-\x08\x0e-\x1a]", head.rstrip(b"\0"))


def read(path: Path, options: Options) -> Log:
    """Open the file, and find its format from the first lines; raises BadLog if that is ambiguous or unknown."""
    lines = Lines(path, options.encoding)
    head = decode(lines.head(), lines.encoding if not lines.mark else None).split("\n")
    try:
        dialect = find_dialect([line.rstrip("\r") for line in head], options)
    except BadContent as problem:
        raise BadLog(f"{path}: {problem}") from None
    facts = {
        "delimiter": NAMES.get(dialect.delimiter, dialect.delimiter),
        "decimal mark": dialect.decimal,
        "header": f"{dialect.header} lines" if dialect.names else "none: columns are numbered from 0",
    }
    shown = dialect.channels[: len(dialect.channels) - dialect.has_trailing]
    time = next((channel.name for channel in shown if channel.kind == "time"), "")
    dated = next((stamps for stamps in dialect.stamps.values() if stamps.has_date), None)
    return TextLog(
        path, "text", shown, time=time, started=dated.first_moment if dated else "",
        zone=("UTC" if dated.zoned else "local") if dated else "", facts=facts, comments=list(dialect.preamble),
        dialect=dialect, encoding=options.encoding, warnings=list(dialect.remarks), unread=dialect.unread,
    )  # fmt: skip


@dataclass
class TextLog(Log):
    """An opened text log."""

    dialect: Dialect = field(kw_only=True)
    encoding: str | None = None

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        yield from read_ahead(_Reading(self, self.dialect, tuple(names)).blocks())


class _Reading:
    def __init__(self, log: TextLog, dialect: Dialect, names: tuple[str, ...]) -> None:
        self.log, self.dialect, self.names = log, dialect, names
        self.width = len(dialect.channels)
        self.columns = {c.name: i for i, c in enumerate(dialect.channels) if c.name in names}
        behind = [self.width - 1] if dialect.has_trailing else []  # a column that must stay empty
        self.wanted = sorted({*self.columns.values(), *behind})
        self.rows = self.narrow = self.first_narrow = self.no_rows = self.headers = self.first_header = 0
        self.times = {i: stamps.seconds for i, stamps in dialect.stamps.items() if i in self.wanted}
        self.days = {i: Unwrapped() for i in self.times if not dialect.stamps[i].has_date}

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks of samples; raises BadLog at a cell that is not a number, or a row with too many cells."""
        lines = Lines(self.log.path, self.log.encoding)
        skip = self.dialect.header
        for first, block, _ in lines.blocks():
            if skip:
                block = block.split(b"\n", skip)[-1]
                first, skip = first + skip, 0
            if block.strip():
                yield self._block(first, block)
        self._close(lines)

    def _block(self, first: int, block: bytes) -> Block:
        if self.dialect.framed:
            block = FRAME_BYTES.sub(b"", block)
        if b"#" in block or b"%" in block:
            block = self._without_comments(first, block)
        cells = self._at_once(block)
        if cells is None:
            block = self._without_comments(first, block)
            cells = self._at_once(block, MISSING) or self._row_by_row(first, block)
        self.rows += cells.rows
        for i, unwrapped in self.days.items():
            cells.columns[i] = unwrapped(cells.columns[i])
        nulls = {name: cells.nulls[i] for name, i in self.columns.items()}
        return self.log.count_nans({name: cells.columns[i] for name, i in self.columns.items()}, nulls)

    def _without_comments(self, first: int, block: bytes) -> bytes:
        def blank(match: re.Match[bytes]) -> bytes:
            if match[0].strip():
                self._comment(first + block.count(b"\n", 0, match.start()), decode(match[0], self.log.encoding))
            return b""

        return block if self.dialect.marked else NO_ROW.sub(blank, block)

    def _comment(self, line: int, text: str) -> None:
        self.no_rows += 1
        if self.no_rows <= MAX_LISTED_LINES:
            self.log.comments.append(f"line {line}: {text.strip()}")

    def _at_once(self, block: bytes, missing: Iterable[str] = ()) -> Cells | None:
        """Parse a block whose rows are all regular, else return None."""
        dialect = self.dialect
        if dialect.delimiter == " " and dialect.quoted:
            return None
        if dialect.delimiter == " ":
            block = b"\n".join(b" ".join(row.split()) for row in block.split(b"\n"))
        form = self.width, dialect.delimiter.encode(), dialect.decimal.encode()
        try:
            cells = parse(block, *form, self.wanted, quoted=dialect.quoted, times=self.times, missing=missing)
        except UNREADABLE:
            return None
        return None if dialect.has_trailing and cells.nulls[self.width - 1] < cells.rows else cells

    def _row_by_row(self, first: int, block: bytes) -> Cells:
        """Parse any other block: keep only the wanted cells, and locate a cell that is not a number."""
        rows, lines = [], []
        for line, row in enumerate(block.split(b"\n"), start=first):
            if row.strip():
                text = decode(row, "latin-1")
                cells = split_cells(text, self.dialect.delimiter)
                if self._is_row(line, text, cells):
                    rows.append(self._fitted(line, cells))
                    lines.append(line)
        by_column = {i: [row[i] for row in rows] for i in self.wanted}
        nulls = {i: sum(cell in ABSENT for cell in cells) for i, cells in by_column.items()}
        columns = {i: self._converted(i, lines, cells) for i, cells in by_column.items()}
        return Cells(len(rows), columns, nulls, texts=[])

    def _converted(self, column: int, lines: Sequence[int], cells: Sequence[str]) -> Array:
        """Convert the cells of a column, which stand in these lines, to numbers."""
        decimal, is_time = self.dialect.decimal, column in self.times
        matches = self.dialect.stamps[column].pattern.fullmatch if is_time else NUMBERS[decimal].fullmatch
        for line, cell in zip(lines, cells, strict=True):
            if cell not in ABSENT and not matches(cell if is_time else cell.removesuffix(decimal)):
                raise BadLog(self._no_number(line, column, cell))
        if not is_time:
            return np.array([number_in(cell, decimal) for cell in cells])
        try:
            return self.times[column](pa.chunked_array([[None if c in ABSENT else c for c in cells]], pa.string()))
        except UNREADABLE as bad:
            what = f"from this line on there is a time that is not a valid date ({bad})"
            remedy = "correct the cell, or take the row out of the log"
            raise BadLog(f"{self.log.path}:{lines[0]}: {what}; {remedy}") from None

    def _is_row(self, line: int, row: str, cells: list[str]) -> bool:
        """Whether a line holds samples, and no remark or the header again; raises BadLog at another header."""
        number, times = NUMBERS[self.dialect.decimal], self.dialect.stamps
        if any(map(number.fullmatch, cells)) or not any(cell and cell not in MISSING for cell in cells):
            return True
        if any(times[i].pattern.fullmatch(cells[i]) for i in times if i < len(cells)):
            return True
        text = decode(row.encode("latin-1"), self.log.encoding).strip()
        if text in self.dialect.header_lines:
            self.headers, self.first_header = self.headers + 1, self.first_header or line
        elif len(cells) < self.width:
            self._comment(line, text)
        elif self.width > 1:
            what = f"{text[:80]!r} is neither a row nor the header"
            remedy = "if another table begins here, save each as a file of its own, else take the line out of the log"
            raise BadLog(f"{self.log.path}:{line}: {what}; {remedy}")
        return self.width == 1 and text not in self.dialect.header_lines

    def _fitted(self, line: int, cells: list[str]) -> list[str]:
        width, trailing = self.width, self.dialect.has_trailing
        where = f"{self.log.path}:{line}: the row has {len(cells)} cells, but the log has {width - trailing} columns"
        if any(cells[width:]) or (trailing and NUMBERS[self.dialect.decimal].fullmatch("".join(cells[width - 1 :]))):
            raise BadLog(f"{where}; correct the row, or set `delimiter` and `decimal` for this log in study.toml")
        if len(cells) < width - trailing:
            if self.dialect.delimiter == " ":
                raise BadLog(f"{where} between blanks, so which are missing is not known; export with a delimiter")
            self.narrow, self.first_narrow = self.narrow + 1, self.first_narrow or line
        return cells + [""] * (width - len(cells))

    def _no_number(self, line: int, column: int, cell: str) -> str:
        what, remedy = "time in the format of the rows before", "take the row out of the log"
        if column not in self.times:
            what = f"number with the decimal mark {self.dialect.decimal!r}"
            remedy = "set `decimal` for this log in study.toml"
        text = decode(cell.encode("latin-1"), self.log.encoding)[:40]
        where = f"{text!r} in column {column} ({self.dialect.channels[column].name})"
        if readings := both_readings(cell):
            return f"{self.log.path}:{line}: {where} {readings}"
        return f"{self.log.path}:{line}: {where} is not a {what}; correct the cell, or {remedy}"

    def _close(self, lines: Lines) -> None:
        """Add the warnings that are only known at the end of the file."""
        say = self.log.warnings.append
        if self.narrow:
            say(f"line {self.first_narrow}: the first of {self.narrow} rows with too few cells; missing ones are nulls")
        if self.no_rows:
            say(f"{self.no_rows} lines between the rows hold no samples, and are listed as comments")
        if self.headers:
            say(f"line {self.first_header}: the header again, so this file may hold more than one recording")
        if lines.cut.strip():
            self.log.dropped += 1
            say(f"line {lines.cut_at}: the file ends within this row, which is dropped")
        if not self.rows:
            say("the file holds no complete row")
        self.log.warnings += lines.remarks()
