"""Excel's workbooks (.xlsx): the columns of each sheet, below a row of names, read row by row with openpyxl."""

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs import isolated
from davinci_forces.logs.arrays import MAX_COLUMNS
from davinci_forces.logs.log import Block, Channel, Log, unique, unit_in

FIRST_MEMBERS = (b"[Content_Types].xml", b"_rels/.rels", b"docProps/", b"xl/")
BLOCK_ROWS_SHEET = 1 << 12
MAX_HEAD = 50  # rows above the first row of numbers
MAX_UNPACKED = 1 << 30  # [bytes] of a workbook: a million rows of twenty columns

Row = tuple[Any, ...]
read = partial(isolated.read, reader=__name__, package="openpyxl")


def recognises(path: Path, head: bytes) -> bool:
    """Whether it is a zip file of a workbook."""
    is_named = path.suffix.lower() in (".xlsx", ".xlsm")
    return head.startswith(b"PK") and (is_named or head[30:].startswith(FIRST_MEMBERS))


def open_in_child(path: Path) -> Log:
    """Open the longest sheet of a workbook; raises BadLog if none has columns of numbers below their names."""
    with zipfile.ZipFile(path) as archive:
        size = sum(info.file_size for info in archive.infolist())
    if size > MAX_UNPACKED:
        raise BadLog(f"{path}: unpacked it has {size >> 20} MB, more than {MAX_UNPACKED >> 20}; export it as CSV")
    with _book(path) as book:
        sheets = {sheet.title: sheet for sheet in book.worksheets}
        heads = {title: _head(sheet.iter_rows(values_only=True, max_row=MAX_HEAD)) for title, sheet in sheets.items()}
        tables = {title: head for title, head in heads.items() if head}
        if not tables:
            raise BadLog(f"{path}: none of its sheets ({', '.join(sheets)}) has columns of numbers below their names")
        title = max(tables, key=lambda title: sheets[title].max_row or 0)
    names, units, skipped, first = tables[title]
    log = SheetLog(path, "xlsx", (), sheet=title, skipped=skipped)
    kinds = ["time" if isinstance(v, datetime) else "number" if _is_number(v) else "text" for v in first]
    called = unique(names)
    log.channels = tuple(
        Channel(name, unit or ("s" if kind == "time" else unit_in(name)), kind)
        for name, unit, kind in zip(called, units, kinds, strict=True)
    )
    log.facts["sheet"] = title
    if more := [other for other in tables if other != title]:
        log.warnings.append(f"the sheets {', '.join(more)} are left out: the longest, {title!r}, is read")
    if stamp := next((value for value in first if isinstance(value, datetime)), None):
        log.origin = stamp.replace(microsecond=0)
        log.started, log.zone = log.origin.isoformat(), "local"
        log.time = next(channel.name for channel in log.channels if channel.kind == "time")
    return log


def _book(path: Path) -> closing[Any]:
    from openpyxl import load_workbook

    return closing(load_workbook(path, read_only=True, data_only=True))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | timedelta | time)


def _head(rows: Iterator[Row]) -> tuple[list[str], list[str], int, Row] | None:
    """Find names and units of columns right above the first row with a number, the number of that row, and the row."""
    above: list[Row] = []
    for number, row in enumerate(rows):
        if not any(_is_number(value) or isinstance(value, date) for value in row):
            above.append(row)
            continue
        texts = [[str(value or "").strip() for value in one] for one in above]
        filled = [one for one in texts if sum(map(bool, one)) > 1] or [one for one in texts if any(one)]
        if not filled or len(row) > MAX_COLUMNS:
            return None
        short = len(filled) > 1 and all(len(cell) <= 8 for cell in filled[-1])
        is_units = short and all(name for name, unit in zip(*filled[-2:], strict=False) if unit)
        names, units = (filled[-2], filled[-1]) if is_units else (filled[-1], [""] * len(row))
        last = max(i for i, value in enumerate(row) if value is not None) + 1
        width = max(last, *(i + 1 for i, name in enumerate(names) if name))
        padded = [[*cells, *[""] * width][:width] for cells in (names, units)]
        return padded[0], [unit.strip("[]()") for unit in padded[1]], number, (*row, *[None] * width)[:width]
    return None


@dataclass
class SheetLog(Log):
    """A sheet of an opened workbook.  Dates become seconds from the whole second of the first."""

    sheet: str = ""
    skipped: int = 0  # rows above the samples
    origin: datetime = datetime.min

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        place = {channel.name: i for i, channel in enumerate(self.channels) if channel.name in names}
        with _book(self.path) as book:
            numbered = enumerate(book[self.sheet].iter_rows(values_only=True))
            samples = ((i, row) for i, row in numbered if i >= self.skipped and any(v is not None for v in row))
            while rows := list(islice(samples, BLOCK_ROWS_SHEET)):
                cells = {name: [(i, row[k] if k < len(row) else None) for i, row in rows] for name, k in place.items()}
                block = {name: np.array([self._number(cell, i, name) for i, cell in cells[name]]) for name in names}
                missing = {name: sum(cell is None or cell == "" for _, cell in cells[name]) for name in names}
                yield self.count_nans(block, missing)

    def _number(self, cell: Any, row: int, name: str) -> float:
        if cell is None or cell == "":
            return float("nan")
        if isinstance(cell, datetime):
            return (cell - self.origin).total_seconds()
        if isinstance(cell, timedelta):
            return cell.total_seconds()
        if isinstance(cell, time):
            return cell.hour * 3600 + cell.minute * 60 + cell.second + cell.microsecond / 1e6
        try:
            return float(cell)
        except (TypeError, ValueError):
            text = f"{cell}"[:40]
            where = f"sheet {self.sheet!r}, row {row + 1}, column {name!r}"
            raise self.bad(f"{where}: {text!r} is not a number; correct the cell, or empty it") from None
