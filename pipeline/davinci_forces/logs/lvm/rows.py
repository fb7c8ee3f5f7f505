"""Read the rows of a LabVIEW measurement file in one pass: samples, numbers of the writes, and warnings."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.cells import UNREADABLE, Cells, NotANumber, marks, parse_carefully, parse_either
from davinci_forces.logs.lines import Lines, decode
from davinci_forces.logs.log import BadContent, Block, Log, Options, read_ahead
from davinci_forces.logs.lvm.header import Layout, X, unescape
from davinci_forces.logs.lvm.walk import WRITTEN, Run, Walk
from davinci_forces.logs.timeline import OwnClock
from davinci_forces.maths.arrays import Array

MIN_ABSOLUTE_X = 1e9  # [s] an x above this counts from 1904, not from the start of the file segment
MAX_COMMENTS = 1000
MAX_REMARKS_OF_A_KIND = 5  # remarks that differ in numbers only; further ones are counted


@dataclass
class LvmLog(Log):
    """An opened LVM file; `elapsed` is derived if several file segments have a date: time [s] since the first start."""

    options: Options = field(default_factory=Options)
    clocks: tuple[OwnClock, ...] = ()  # of channels that were not sampled with the first channel

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        yield from read_ahead(Reading(self, names).blocks())


class Reading:
    """A pass over the file; its warnings and counts go into the log."""

    def __init__(self, log: LvmLog, names: Sequence[str]) -> None:
        self.log, self.names, self.encoding = log, tuple(names), log.options.encoding
        [clock] = log.by_clock(names) or [""]
        self.elapsed = next((c.name for c in log.channels if c.derived and c.kind != "time"), "")
        self.own = next((c for c in log.clocks if c.time == clock), None)
        others = {name for c in log.clocks for name in (*c.channels, c.x)}
        written = [c.name for c in log.channels if not c.derived and not c.name.startswith(X)]
        first = tuple(name for name in written if name not in others) if others else ()
        self.together = (*self.own.channels, self.own.x) if self.own else first  # some have a sample in a row
        self.kinds: Counter[str] = Counter()  # of remarks, without their numbers
        self.walk, self.lines = Walk(self.encoding, self.say), Lines(log.path, self.encoding)
        self.rows = self.rows_in_segment = self.back = 0
        self.went_back = ""
        self.last_x = np.nan
        self.file_segment: Layout | None = None
        self.first: Layout | None = None
        self.marked = False

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks of samples; raises BadLog at a cell that is not a number, or an unreadable header."""
        try:
            for block in self.lines.blocks():
                for run, cells in self.walk.runs(block, self._at_once):
                    yield self._block(run, cells or self._carefully(run))
            self.walk.finish()
        except BadContent as problem:
            raise BadLog(f"{self.log.path}:{self.walk.line}: {problem}") from None
        self._close()

    def say(self, remark: str) -> None:
        """Add a warning; after the first few that differ only in their numbers, the others are counted."""
        kind = re.sub(r"\d+", "#", remark)
        self.kinds[kind] += 1
        if self.kinds[kind] <= MAX_REMARKS_OF_A_KIND:
            self.log.warnings.append(remark)

    def _at_once(self, run: Run, lines: int) -> Cells | None:
        """Parse the cells of a run, or return None if it is no run: a header's tag in column 0 is not a number."""
        separator, text = run.layout.file.separator, run.width - 1 if run.commented else -1
        if run.commented and len(marks(run.block, separator)) > 1:
            return None
        try:
            cells = parse_either(run.block, run.width, separator, self._columns(run), text)
        except UNREADABLE:
            return None
        if cells.rows != lines or (run.layout.file.x_columns == "No" and cells.nulls[0] < cells.rows):
            return None
        if any(cell and WRITTEN.fullmatch(cell) for cell in cells.texts):
            return None
        run.comments = [(run.line(row), cell) for row, cell in enumerate(cells.texts) if cell]
        return cells

    def _carefully(self, run: Run) -> Cells:
        try:
            return parse_carefully(run.block, run.width, run.layout.file.separator, self._columns(run))
        except NotANumber as bad:
            row, column, cell = bad.args
            text = decode(cell)
            shown = repr(text if len(text) <= 40 else f"{text[:37]}...")
            where = f"{shown} in column {column} ({run.name(column) or 'x'})"
            what = "is not a number; correct the cell, or take the row out of the log"
            raise BadLog(f"{self.log.path}:{run.line(row)}: {where} {what}") from None

    def _columns_of(self, run: Run, channels: Sequence[str]) -> dict[int, str]:
        names = ((i, run.name(i)) for i in range(run.width - run.commented))
        return {i: name for i, name in names if name in channels}

    def _columns(self, run: Run) -> list[int]:
        return sorted({0, *self._columns_of(run, self.names), *self._columns_of(run, self.together)})

    def _block(self, run: Run, cells: Cells) -> Block:
        wanted = self._columns_of(run, self.names)
        block: Block = {name: cells.columns[i] for i, name in wanted.items()}
        empty = {name: cells.empty[i] for i, name in wanted.items() if i in cells.empty}
        x = cells.columns[0] if run.layout.file.x_columns != "No" else None
        self.first = self.first or run.layout
        before = self.rows_in_segment if run.layout is self.file_segment else 0
        self._look_back(run, x)
        self._look_at(run, cells.rows)
        if self.elapsed in self.names:
            block[self.elapsed] = self._since_start(run, x, cells.rows, before, self.first.first_channel)
        if self.own and self.own.time in self.names:
            columns = self._columns_of(run, [self.own.x] if self.own.x else [])
            own_x = next((cells.columns[i] for i in columns), None)
            block[self.own.time] = self._since_start(run, own_x, cells.rows, before, self.own.channels[0])
        for name in set(self.names) - set(block):
            block[name], empty[name] = np.full(cells.rows, np.nan), np.ones(cells.rows, dtype=bool)
        self.rows += cells.rows
        together = self._columns_of(run, self.together)
        if self.together and all(i in cells.empty for i in together):  # rows may lack all samples of this clock
            held = ~np.all([np.ones(cells.rows, dtype=bool), *(cells.empty[i] for i in together)], axis=0)
            block = {name: values[held] for name, values in block.items()}
            empty = {name: which[held] for name, which in empty.items()}
        nulls = {name: int(np.count_nonzero(which)) for name, which in empty.items()}
        return self.log.count_nans({name: block[name] for name in self.names}, nulls)

    def _look_at(self, run: Run, rows: int) -> None:
        ends = [*(row for row, _ in run.file_segments[1:]), rows]
        for (first, layout), end in zip(run.file_segments, ends, strict=True):
            if layout is not self.file_segment:
                self._check_samples()
                self.file_segment, self.rows_in_segment = layout, 0
                if absent := sorted({*(self.first or run.layout).names} - {*layout.names}):
                    self.say(f"line {layout.line}: from here on without {', '.join(absent)}, read as nulls")
            self.rows_in_segment += end - first
        for line, cell in run.comments[: MAX_COMMENTS - len(self.log.comments)]:
            self.log.comments.append(f"line {line}: {unescape(cell, self.encoding)}")
        stated, written = run.layout.file.decimal, decode(marks(run.block, run.layout.file.separator))
        if not self.marked and not run.commented and (len(written) > 1 or (stated and written and written != stated)):
            self.marked = True
            usage = f"but cells use {' and '.join(map(repr, written))}; each cell is read with its own"
            self.say(f"line {run.first}: the header's decimal mark is {stated or 'not given'!r}, {usage}")

    def _look_back(self, run: Run, x: Array | None) -> None:
        """Count the rows where x does not increase, but for those behind a header or a blank line."""
        if x is None or not len(x):
            return
        before = np.concatenate(([self.last_x], x[:-1]))
        is_back = x <= before
        is_back[run.begins] = False
        if is_back.any() and not self.back:
            i = int(np.argmax(is_back))
            word = "stands still at" if x[i] == before[i] else f"goes back from {before[i]:g} to"
            self.went_back = f"line {run.line(i)}: x {word} {x[i]:g} in row {self.rows + i + 1}"
        self.back += int(np.count_nonzero(is_back))
        self.last_x = x[-1]

    def _since_start(self, run: Run, x: Array | None, rows: int, before: int, channel: str) -> Array:
        """Compute the time [s] since the start of the first file segment, of which `before` rows precede the run."""
        firsts = np.array([row for row, _ in run.file_segments])
        counts = np.diff(firsts, append=rows)
        samplings = [layout.sampling.get(channel) or layout.first_sampling for _, layout in run.file_segments]
        zero = self.first.start if self.first else None
        dates = (sampling.start for sampling in samplings)
        starts = [np.nan if start is None or zero is None else float(start - zero) for start in dates]
        if x is None:
            x0, step = [sampling.x0 for sampling in samplings], [sampling.step for sampling in samplings]
            number = np.arange(rows) - np.repeat(firsts, counts)
            number[: counts[0]] += before
            x = np.repeat(x0, counts) + np.repeat(step, counts) * number
        return np.where(np.abs(x) > MIN_ABSOLUTE_X, x, x + np.repeat(starts, counts))

    def _check_samples(self) -> None:
        """Check the header's count of samples: of its write, or with a single header of the first write only."""
        if self.file_segment is None or self.file_segment.samples is None:
            return
        line, stated, rows = self.file_segment.line, self.file_segment.samples, self.rows_in_segment
        if rows < stated or (rows > stated and self.file_segment.file.several):
            self.say(f"line {line}: the header states {stated} samples, but {rows} rows follow; these are read")

    def _close(self) -> None:
        """Add the warnings that are only known at the end of the file."""
        self._check_samples()
        walk, lines, say = self.walk, self.lines, self.say
        if self.rows and walk.layout is not self.file_segment:
            say(f"line {walk.line}: the file ends after the header of a file segment, which holds no rows")
        if not self.rows:
            say("the file holds headers but no rows: the recorder stopped before its first write")
        if self.back:
            again = f" (the first of {self.back} times)" if self.back > 1 else ""
            say(f"{self.went_back}{again}; the rows are kept")
        if walk.narrow:
            say(f"line {walk.first_narrow}: the first of {walk.narrow} rows with too few cells; missing ones are nulls")
        for cells, line in sorted(walk.wide.items()):
            say(f"line {line}: the first row of {cells} cells, more than the header names; see column_<number>")
        if lines.cut and self.walk.state == "row":
            self.log.dropped += 1
            say(f"line {lines.cut_at}: the file ends within this row, which is dropped")
        elif lines.cut:
            say(f"line {lines.cut_at}: the file ends within this line, which is not used")
        for remark in lines.remarks():
            say(remark)
        for kind, count in self.kinds.items():
            if count > MAX_REMARKS_OF_A_KIND:
                self.log.warnings.append(f"{count - MAX_REMARKS_OF_A_KIND} more times: {kind}")
