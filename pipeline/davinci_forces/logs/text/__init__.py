"""Columns of numbers in text, with or without a header, with any delimiter and decimal mark."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs.cells import UNREADABLE, Cells, NotANumber, check, parse
from davinci_forces.logs.lines import GZIP, Lines, decode
from davinci_forces.logs.log import Block, Channel, Log, Options, read_ahead
from davinci_forces.logs.text.dialect import NAMES, Dialect, Unclear, find_dialect, split_cells
from davinci_forces.logs.text.stamps import REMARK, Unwrapped, clocks_may_change

VALUE_BYTES = rb"[+-]?((\d+MARK?\d*|MARK\d+)([eE][+-]?\d+)?|nan|inf|infinity)"
NUMBER_PATTERNS_BYTES = {
    mark.decode(): re.compile(VALUE_BYTES.replace(b"MARK", re.escape(mark)), re.IGNORECASE) for mark in (b".", b",")
}


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file may be text: it holds no control characters, or it is zipped."""
    wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    return head.startswith(GZIP) or wide or not re.search(rb"[\x00-\x08\x0e-\x1a]", head.rstrip(b"\0"))


def read(path: Path, options: Options) -> Log:
    """Open the file, and find its format from the first lines.

    Raises
    ------
    BadLog
        If the format is ambiguous or unknown; the message names the key of study.toml to set.
    """
    lines = Lines(path, options.encoding)
    head = decode(lines.head(), lines.encoding if not lines.mark else None).split("\n")
    try:
        dialect = find_dialect([line.rstrip("\r") for line in head], options)
    except Unclear as problem:
        raise BadLog(f"{path}: {problem}") from None
    channels = tuple(
        Channel(name, unit, kind) for name, unit, kind in zip(dialect.names, dialect.units, dialect.kinds, strict=True)
    )
    facts = {
        "delimiter": NAMES.get(dialect.delimiter, dialect.delimiter),
        "decimal mark": dialect.decimal,
        "header": f"{dialect.header} lines" if dialect.named else "none: columns are numbered from 0",
    }
    shown = channels[: len(channels) - dialect.trailing]
    comments = list(dialect.preamble)
    time = next((channel.name for channel in shown if channel.kind == "time"), "")
    dated = next((stamps for stamps in dialect.stamps.values() if stamps.has_date), None)
    return TextLog(
        path, "text", shown, time=time, started=dated.first_moment if dated else "",
        zone=("UTC" if dated.zoned else "local") if dated else "", facts=facts, comments=comments, dialect=dialect,
        encoding=options.encoding, warnings=list(dialect.remarks),
    )  # fmt: skip


@dataclass
class TextLog(Log):
    """An opened text log."""

    dialect: Dialect | None = None
    encoding: str | None = None

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says."""
        self._restart(names, kinds=("number", "time"))
        assert self.dialect is not None
        yield from read_ahead(_Reading(self, self.dialect, tuple(names)).blocks())


class _Reading:
    """One pass over the rows of a text."""

    def __init__(self, log: TextLog, dialect: Dialect, names: tuple[str, ...]) -> None:
        self.log, self.dialect, self.names = log, dialect, names
        self.columns = {name: dialect.names.index(name) for name in names}
        behind = [len(dialect.names) - 1] if dialect.trailing else []  # a column that must stay empty
        self.wanted = sorted({*self.columns.values(), *behind})
        self.rows = self.narrow = self.first_narrow = 0
        self.times = {i: stamps.seconds for i, stamps in dialect.stamps.items() if i in self.wanted}
        self.latest = 0.0  # [s] of columns with dates
        self.days = {i: Unwrapped() for i in self.times if not dialect.stamps[i].has_date}

    def blocks(self) -> Iterator[Block]:
        """Read the blocks of samples.

        Raises
        ------
        BadLog
            At a cell that is not a number, or a row with more cells than columns.
        """
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
        cells = self._at_once(block) or self._row_by_row(first, block)
        self.rows += cells.rows
        for i in self.times.keys() - self.days.keys():
            self.latest = max(self.latest, *cells.columns[i][-1:].tolist())
        for i, unwrapped in self.days.items():
            cells.columns[i] = unwrapped(cells.columns[i])
        nulls = {name: cells.nulls[i] for name, i in self.columns.items()}
        return self.log.count_nans({name: cells.columns[i] for name, i in self.columns.items()}, nulls)

    def _at_once(self, block: bytes) -> Cells | None:
        """Parse a block whose rows are all regular, else return None."""
        dialect = self.dialect
        if dialect.delimiter == " ":
            return None
        delimiter, decimal, width = dialect.delimiter.encode(), dialect.decimal.encode(), len(dialect.names)
        try:
            cells = parse(block, width, delimiter, decimal, self.wanted, quoted=dialect.quoted, times=self.times)
        except UNREADABLE:
            return None
        return None if dialect.trailing and cells.nulls[width - 1] < cells.rows else cells

    def _row_by_row(self, first: int, block: bytes) -> Cells:
        """Parse any other block: keep only the wanted cells, and locate a cell that is not a number."""
        rows, lines = [], []
        for line, row in enumerate(block.split(b"\n"), start=first):
            if row.strip():
                texts = self._fitted(line, split_cells(decode(row, "latin-1"), self.dialect.delimiter))
                rows.append([texts[i].encode("latin-1") for i in self.wanted])
                lines.append(line)
        try:
            check(rows, range(len(self.wanted)), [self._pattern(i) for i in self.wanted])
        except NotANumber as bad:
            raise BadLog(self._no_number(lines[bad.row], self.wanted[bad.column], bad.cell)) from None
        text = b"".join(b"\t".join(row) + b"\n" for row in rows).replace(b"\n\n", b"\n \n")
        times = {self.wanted.index(i): seconds for i, seconds in self.times.items()}
        try:
            cells = parse(
                text, len(self.wanted), b"\t", self.dialect.decimal.encode(), range(len(self.wanted)), times=times
            )
        except UNREADABLE as bad:
            raise BadLog(
                f"{self.log.path}:{lines[0]}: from this line on there is a time that is not a valid date ({bad}); "
                "correct the cell, or take the row out of the log"
            ) from None
        columns = {self.wanted[i]: column for i, column in cells.columns.items()}
        return Cells(cells.rows, columns, {self.wanted[i]: count for i, count in cells.nulls.items()}, texts=[])

    def _pattern(self, column: int) -> re.Pattern[bytes]:
        """Return the pattern of the cells of a column."""
        if column in self.times:
            return re.compile(self.dialect.stamps[column].pattern.pattern.encode())
        return NUMBER_PATTERNS_BYTES[self.dialect.decimal]

    def _fitted(self, line: int, cells: list[str]) -> list[str]:
        """Fill up the cells of a row to the number of columns."""
        width = len(self.dialect.names)
        if any(cells[width:]):
            raise BadLog(
                f"{self.log.path}:{line}: the row has {len(cells)} cells, but the log has {width} columns; correct the "
                "row, or set `delimiter` and `decimal` for this log in study.toml"
            )
        if len(cells) < width - self.dialect.trailing:
            self.narrow, self.first_narrow = self.narrow + 1, self.first_narrow or line
        return cells + [""] * (width - len(cells))

    def _no_number(self, line: int, column: int, cell: bytes) -> str:
        what, remedy = "time in the format of the rows before", "take the row out of the log"
        if column not in self.times:
            what = f"number with the decimal mark {self.dialect.decimal!r}"
            remedy = "set `decimal` for this log in study.toml"
        where = f"{decode(cell, self.log.encoding)[:40]!r} in column {column} ({self.dialect.names[column]})"
        return f"{self.log.path}:{line}: {where} is not a {what}; correct the cell, or {remedy}"

    def _close(self, lines: Lines) -> None:
        """Add the warnings that are only known at the end of the file."""
        say = self.log.warnings.append
        if self.narrow:
            say(f"line {self.first_narrow}: the first of {self.narrow} rows with too few cells; missing ones are nulls")
        if lines.cut.strip():
            self.log.dropped += 1
            say(f"line {lines.cut_at}: the file ends within this row, which is dropped")
        if not self.rows:
            say("the file holds no complete row")
        if self.latest and self.log.zone == "local":
            ended = datetime.fromisoformat(self.log.started) + timedelta(seconds=self.latest)
            if clocks_may_change(self.log.started, ended.isoformat()):
                say(f"the log began at {self.log.started} and ended at {ended.isoformat()}: {REMARK}")
        if lines.padding:
            say(f"{lines.padding} NUL bytes at the end of the file, typical of a power cut, are not read")
        if lines.damage:
            say(lines.damage)
