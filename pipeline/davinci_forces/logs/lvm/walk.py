"""Separate headers and rows of a LabVIEW measurement file: headers are parsed, rows form runs of one layout.

A block whose rows all have the width of the layout is passed on as it is.  Any other block is read line by line:
comments are removed from the rows, and rows are filled up to one width.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from davinci_forces.logs.cells import NUMBER
from davinci_forces.logs.lines import Block
from davinci_forces.logs.log import BadContent
from davinci_forces.logs.lvm.header import END, MAGIC, FileHeader, Layout, X, file_header, layout
from davinci_forces.logs.timeline import refine_groups

WRITTEN = re.compile(rb"-?\d+[.,]\d+(E[+-]?\d+)?|NaN|-?Inf")  # as LabVIEW writes a number: always with a fraction
LINEWISE_BYTES = 1 << 16  # [bytes] of a block that is read line by line
MAX_HEADER_LINES = 10_000  # lines
BEGINS_NUMBER = b"0123456789-+.,"
TAGS = frozenset(
    b"Channels Samples Date Time X_Dimension X_Unit_Label Y_Dimension Y_Unit_Label X0 Delta_X Notes Test_Name "
    b"Test_Numbers Test_Series UUT_Name UUT_M/N UUT_S/N ***End_of_Header***".split()
)


@dataclass
class Run:
    """Consecutive rows with the same columns, of one or more file segments, all of `width` cells."""

    layout: Layout  # of the first file segment
    width: int
    first: int  # line of its first row
    block: bytes = b""
    commented: bool = False  # the last cell of every row may hold a comment
    lines: list[int] | None = None  # line of each row, where they are not consecutive
    begins: list[int] = field(default_factory=list)  # rows behind a header or a blank line
    comments: list[tuple[int, bytes]] = field(default_factory=list)  # with their lines
    file_segments: list[tuple[int, Layout]] = field(default_factory=list)  # the row that each begins at

    def line(self, row: int) -> int:
        """Return the line of a row."""
        return self.lines[row] if self.lines is not None else self.first + row

    def name(self, column: int) -> str:
        """Return the channel of a column, or `column_<number>` for a column that the layout lacks."""
        return self.layout.names[column] if column < self.layout.width else f"column_{column}"

    def looks_whole(self, lines: int) -> bool | None:
        """True if the separators fit this number of rows and no header ends in the block, None otherwise."""
        separators = int(np.count_nonzero(np.frombuffer(self.block, np.uint8) == ord(self.layout.file.separator)))
        headed = b"*" in self.block and END in self.block  # finding a character is far faster than a word
        return (separators == lines * (self.width - 1) and not headed) or None


Taken = TypeVar("Taken")


@dataclass
class Walk:
    """State of a pass over a file, and the problems of its lines; `say` is called with each warning."""

    encoding: str | None
    say: Callable[[str], None]
    file: FileHeader = field(default_factory=FileHeader)
    layout: Layout | None = None
    line: int = 0
    met: dict[tuple[str, ...], Layout] = field(default_factory=dict)  # the first file segment with these columns
    groups: list[list[str]] = field(default_factory=list)  # channels that were sampled together in all file segments
    file_segments: int = 0
    narrow: int = 0  # rows with too few cells
    first_narrow: int = 0  # line of the first of them
    wide: dict[int, int] = field(default_factory=dict)  # number of cells, if too many -> line of the first such row
    state: str = "before"
    _header: list[bytes] = field(default_factory=list)
    _begins: bool = True  # the next row is behind a header or a blank line
    _rowless: bool = False  # no row since the last header
    _run: Run | None = None
    _rows: list[bytes] = field(default_factory=list)
    _done: list[Run] = field(default_factory=list)

    def runs(self, block: Block, take: Callable[[Run, int], Taken | None]) -> Iterator[tuple[Run, Taken | None]]:
        """Split a block of complete lines into runs of rows.

        `take` is called with a possible run and its number of lines, and returns None if it is no run.  Such a block is
        halved, until only the lines around the problem are read one by one.  Raises BadContent if a header makes the
        file unreadable; `line` says where.
        """
        run = self._whole(block)
        if run and (taken := take(run, block.lines)) is not None:
            self._begins = self._rowless = False
            self.line = block.first + block.lines - 1
            yield run, taken
        elif len(block.text) > LINEWISE_BYTES and block.lines > 1:
            for half in block.halves():
                yield from self.runs(half, take)
        else:
            for run in self._line_by_line(block):
                yield run, None

    def _whole(self, block: Block) -> Run | None:
        """Make the block one run, if its first line is a row with or without a comment."""
        if self.state != "row" or self.layout is None:
            return None
        first = block.text[: block.text.find(b"\n")]
        width = first.count(self.layout.file.separator) + 1
        if width not in (self.layout.width, self.layout.width + 1):
            return None
        begins = [0] if self._begins else []
        commented, file_segments = width > self.layout.width, [(0, self.layout)]
        return Run(self.layout, width, block.first, block.text, commented, begins=begins, file_segments=file_segments)

    def _line_by_line(self, block: Block) -> Iterator[Run]:
        for self.line, line in enumerate(block.text.split(b"\n")[:-1], start=block.first):
            handle = getattr(self, f"_{self.state}")
            self.state = handle(line.rstrip(b"\r"))
            if self._done:
                yield self._done.pop()
        self._finish_run()
        if self._done:
            yield self._done.pop()

    def finish(self) -> None:
        """Check that the file did not end within a header; raises BadContent if it has no column line."""
        if self.state == "row" or (self.state == "between" and self.layout):
            return
        problem = {
            "special": "the special block is not closed by ***End_Special***",
            "columns": f"the column line, which names the channels and begins with {X}, is missing",
            "between": "no header of a file segment follows the file's header",
        }.get(self.state, f"no line {END.decode()} ends the header")
        if self.layout is None:
            raise BadContent(f"{problem}; without it the samples have no names")
        self.say(f"line {self.line}: the file ends within a header ({problem}); the rows before it are read")

    def _before(self, line: bytes) -> str:
        self._header = [line]
        return "file"

    def _file(self, line: bytes) -> str:
        if not line.startswith(END):
            return self._collected(line, "file")
        self.file, self._header = file_header(self._header, self.encoding), []
        return "between"

    def _between(self, line: bytes) -> str:
        first = line.split(self.file.separator, 1)[0].strip()
        if not line.strip(self.file.separator + b" "):
            return "between"
        if self._is_header(line, first):
            return self._headed(line, first)
        if self.layout and (not first or NUMBER.fullmatch(first)):
            self.say(f"line {self.line}: rows continue after a blank line without a header; they are read as before")
            self._begins = True
            return self._row(line)
        return self._segment(line)

    def _special(self, line: bytes) -> str:
        return "between" if line.startswith(b"***End_Special***") else "special"

    def _segment(self, line: bytes) -> str:
        if line.startswith(END):
            return "columns"
        return self._collected(line, "segment")

    def _columns(self, line: bytes) -> str:
        if self._rowless and self.layout:
            self.say(f"line {self.layout.line}: the file segment whose header ends here holds no rows")
        self.layout = layout(self._header, line, self.file, self.line, self.encoding)
        self._header, self._begins, self._rowless = [], True, True
        sampled = self.layout.sampling
        if self.layout.names not in self.met or len({*sampled.values()}) > 1:
            self.groups = refine_groups(self.groups, sampled, self.file.x_columns == "Multi")
        self.met.setdefault(self.layout.names, self.layout)
        self.file_segments += 1
        for remark in self.layout.remarks:
            self.say(remark)
        return "row"

    def _row(self, line: bytes) -> str:
        assert self.layout is not None
        separator = self.layout.file.separator
        if line[:1] not in BEGINS_NUMBER or not line[:1]:
            first = line.split(separator, 1)[0].strip()
            if self._is_header(line, first):
                return self._headed(line, first)
            if not line.strip(b" ") or (line == separator and self.layout.width != 2):
                return "between"
        self._take(line, separator, self.layout)
        return "row"

    def _is_header(self, line: bytes, first: bytes) -> bool:
        return first in TAGS or first == X.encode() or line.startswith((MAGIC, b"***"))

    def _headed(self, line: bytes, first: bytes) -> str:
        """Begin a header at this line, and return the state for the next line."""
        self._header = []
        if line.startswith(MAGIC):
            if self.layout:
                self.say(f"line {self.line}: the file header is repeated: another session was appended")
            return self._before(line)
        if line.startswith(b"***Start_Special***"):
            return "special"
        return self._columns(line) if first == X.encode() else self._segment(line)

    def _collected(self, line: bytes, state: str) -> str:
        self._header.append(line)
        if len(self._header) > MAX_HEADER_LINES:
            raise BadContent(f"no line {END.decode()} ends the header within {MAX_HEADER_LINES} lines")
        return state

    def _take(self, line: bytes, separator: bytes, layout: Layout) -> None:
        """Add a row to the run, without its comment."""
        if self._run is None or not self._run.layout.is_like(layout):
            self._finish_run()
            self._run, self._rows = Run(layout, layout.width, self.line, lines=[]), []
        run, cells = self._run, line.count(separator) + 1
        assert run.lines is not None
        if not run.file_segments or run.file_segments[-1][1] is not layout:
            run.file_segments.append((len(run.lines), layout))
        if cells != layout.width:
            line, cells = self._fitted(line, cells, separator, layout, run)
        if self._begins:
            run.begins.append(len(run.lines))
        run.width = max(run.width, cells)
        run.lines.append(self.line)
        self._rows.append(line)
        self._begins = self._rowless = False

    def _fitted(self, line: bytes, cells: int, separator: bytes, layout: Layout, run: Run) -> tuple[bytes, int]:
        """Remove trailing empty cells and the comment from a row whose width is not the layout's."""
        while cells > layout.width and line.endswith(separator):
            line, cells = line[: -len(separator)], cells - 1
        row, _, last = line.rpartition(separator)
        if last and ((cells > layout.width and not WRITTEN.fullmatch(last)) or not NUMBER.fullmatch(last.strip())):
            run.comments.append((self.line, last))
            line, cells = row, cells - 1
        if cells > layout.width:
            self.wide.setdefault(cells, self.line)
        elif cells < layout.width:
            if run.lines:  # a comment stands in the last channel in the first row of a write with one channel less
                row, _, last = self._rows[-1].rpartition(separator)
                if last and not NUMBER.fullmatch(last.strip()):
                    run.comments.append((run.lines[-1], last))
                    self._is_narrow(run.lines[-1])
                    self._rows[-1] = row
            self._is_narrow(self.line)
        return line, cells

    def _is_narrow(self, line: int) -> None:
        self.narrow, self.first_narrow = self.narrow + 1, self.first_narrow or line

    def _finish_run(self) -> None:
        run, self._run = self._run, None
        if run is None:
            return
        separator = run.layout.file.separator
        full = (row + separator * (run.width - 1 - row.count(separator)) for row in self._rows)
        run.block = b"\n".join(full) + b"\n"
        self._done.append(run)
