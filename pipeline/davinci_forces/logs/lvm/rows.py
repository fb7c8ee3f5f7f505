"""One pass over the rows of a LabVIEW measurement file: numbers, the numbers of the writes, and what is odd."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadLog
from davinci_forces.logs.cells import UNREADABLE, Cells, NotANumber, marks, parse_carefully, parse_either
from davinci_forces.logs.lines import Lines, decoded
from davinci_forces.logs.log import Block, Log
from davinci_forces.logs.lvm.header import BadHeader, Layout, X, unescaped
from davinci_forces.logs.lvm.walk import WRITTEN, Run, Walk
from davinci_forces.logs.text.stamps import REMARK, clocks_may_change
from davinci_forces.logs.timeline import OwnClock, Sampling
from davinci_forces.maths.arrays import Array, Booleans

DATED = 1e9  # [s] an x beyond this counts from 1904, not from the start of the file segment
MOST_COMMENTS = 1000
MOST = 5  # of a kind that are told one by one
NUMBERS = re.compile(r"\d+")


class Reading:
    """A pass over the file; what it notices goes into the log."""

    def __init__(
        self, log: Log, encoding: str | None, names: tuple[str, ...], clocks: Sequence[OwnClock] = (), clock: str = ""
    ) -> None:
        self.log, self.names, self.encoding = log, names, encoding
        self.derived = [channel.name for channel in log.channels if channel.derived and channel.kind != "time"]
        self.own = next((own for own in clocks if own.time == clock), None)
        others = {name for own in clocks for name in (*own.channels, own.x)}
        written = [c.name for c in log.channels if not c.derived and not c.name.startswith(X)]
        first = tuple(name for name in written if name not in others) if others else ()
        self.together = (*self.own.channels, self.own.x) if self.own else first  # one of them has a sample in a row
        self.say = Remarks(log.warnings)
        self.walk, self.lines = Walk(encoding, self.say), Lines(log.path, encoding)
        self.write = self.rows = self.rows_in_segment = self.back = 0
        self.went_back = ""
        self.last_x = np.nan
        self.file_segment: Layout | None = None
        self.first: Layout | None = None
        self.marked = False

    def blocks(self) -> Iterator[Block]:
        """The blocks of samples.

        Raises
        ------
        BadLog
            At a cell that is no number, or a header that cannot be read past.
        """
        try:
            for block in self.lines.blocks():
                for run, cells in self.walk.runs(block, self._at_once):
                    yield self._block(run, cells or self._carefully(run))
            self.walk.finish()
        except BadHeader as problem:
            raise BadLog(f"{self.log.path}:{self.walk.line}: {problem}") from None
        self._close()

    def _at_once(self, run: Run, lines: int) -> Cells | None:
        """The cells of a run, or None where it is not whole: the tag of a header, in column 0, is no number."""
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
            text = decoded(bad.cell)
            shown = repr(text if len(text) <= 40 else f"{text[:37]}...")
            raise BadLog(
                f"{self.log.path}:{run.line(bad.row)}: {shown} in column {bad.column} ({run.name(bad.column) or 'x'}) "
                "is no number; correct the cell, or take the row out of the log"
            ) from None

    def _wanted(self, run: Run) -> dict[int, str]:
        return self._columns_of(run, self.names)

    def _columns_of(self, run: Run, channels: Sequence[str]) -> dict[int, str]:
        names = ((i, run.name(i)) for i in range(run.width - run.commented))
        return {i: name for i, name in names if name in channels}

    def _columns(self, run: Run) -> list[int]:
        return sorted({0, *self._wanted(run), *self._columns_of(run, self.together)})

    def _block(self, run: Run, cells: Cells) -> Block:
        """The samples of a run, under the names of their channels."""
        block: Block = {name: cells.columns[i] for i, name in self._wanted(run).items()}
        empty = {name: cells.empty[i] for i, name in self._wanted(run).items() if i in cells.empty}
        x = cells.columns[0] if run.layout.file.x_columns != "No" else None
        self.first = self.first or run.layout
        before = self.rows_in_segment if run.layout is self.file_segment else 0
        elapsed = self._since_start(run, x, cells.rows, before, self.first.measured)
        made = (self._writes(run, x, cells.rows), elapsed)
        self._look_at(run, cells.rows)
        for name, values in zip(self.derived, made, strict=False):
            if name in self.names:
                block[name] = values
        if self.own and self.own.time in self.names:
            block[self.own.time] = self._own_times(self.own, run, cells, before)
        for name in set(self.names) - set(block):
            block[name], empty[name] = np.full(cells.rows, np.nan), np.ones(cells.rows, dtype=bool)
        self.rows += cells.rows
        held = self._held(run, cells)
        if held is not None:
            block = {name: values[held] for name, values in block.items()}
            empty = {name: which[held] for name, which in empty.items()}
        nulls = {name: int(np.count_nonzero(which)) for name, which in empty.items()}
        return self.log.tallied({name: block[name] for name in self.names}, nulls)

    def _held(self, run: Run, cells: Cells) -> Booleans | None:
        """Rows that hold a sample of the channels of this clock; None where all do."""
        columns = self._columns_of(run, self.together)
        if not self.together or not all(i in cells.empty for i in columns):
            return None
        none: Booleans = np.ones(cells.rows, dtype=bool)
        for i in columns:
            none &= cells.empty[i]
        return ~none

    def _own_times(self, own: OwnClock, run: Run, cells: Cells, before: int) -> Array:
        """Times of the channels that were not sampled with the first, since the start of the log [s]."""
        column = next(iter(self._columns_of(run, [own.x])), None) if own.x else None
        x = None if column is None else cells.columns[column]
        return self._since_start(run, x, cells.rows, before, own.channels[0])

    def _look_at(self, run: Run, rows: int) -> None:
        """File segments, comments and decimal marks of a run."""
        ends = [*(row for row, _ in run.file_segments[1:]), rows]
        for (first, layout), end in zip(run.file_segments, ends, strict=True):
            if layout is not self.file_segment:
                self._begin_segment(layout)
            self.rows_in_segment += end - first
        for line, cell in run.comments[: MOST_COMMENTS - len(self.log.comments)]:
            self.log.comments.append(f"line {line}: {unescaped(cell, self.encoding)}")
        stated, written = run.layout.file.decimal, decoded(marks(run.block, run.layout.file.separator))
        if not self.marked and not run.commented and (len(written) > 1 or (stated and written and written != stated)):
            self.marked = True
            self.say(
                f"line {run.first}: the header's decimal mark is {stated or 'not given'!r}, cells have "
                f"{' and '.join(map(repr, written))}; each cell is read with its own"
            )

    def _begin_segment(self, layout: Layout) -> None:
        self._check_samples()
        before = self.file_segment.started if self.file_segment else ""
        if before and layout.started and clocks_may_change(before, layout.started):
            self.say(f"line {layout.line}: {REMARK}")
        self.file_segment, self.rows_in_segment = layout, 0
        assert self.first is not None
        if absent := sorted(set(self.first.names) - set(layout.names)):
            self.say(f"line {layout.line}: from here on there is no {', '.join(absent)}: nulls")
        if layout.notes:
            self.say(f"line {layout.line}: the header notes: {layout.notes}")

    def _writes(self, run: Run, x: Array | None, rows: int) -> Array:
        """Number of the write that each row came in: a new one begins where x does not go on."""
        begins = np.zeros(rows, dtype=bool)
        if x is not None and rows:
            before = np.concatenate(([self.last_x], x[:-1]))
            begins = x <= before
            begins[run.begins] = False
            self._went_back(run, np.flatnonzero(begins), before, x)
            self.last_x = x[-1]
        begins[run.begins] = True
        writes = self.write + np.cumsum(begins)
        self.write = int(writes[-1]) if rows else self.write
        return writes.astype(np.float64)

    def _went_back(self, run: Run, rows: NDArray[np.intp], before: Array, x: Array) -> None:
        if len(rows) and not self.back:
            i = rows[0]
            word = "stands still at" if x[i] == before[i] else f"goes back from {before[i]:g} to"
            self.went_back = f"line {run.line(int(i))}: x {word} {x[i]:g} in row {self.rows + int(i) + 1}"
        self.back += len(rows)

    def _since_start(self, run: Run, x: Array | None, rows: int, before: int, channel: str) -> Array:
        """Time since the start of the first file segment [s] by what the headers say of a channel.

        `before` rows of the run's first file segment came already.
        """
        firsts = np.array([row for row, _ in run.file_segments])
        counts = np.diff(firsts, append=rows)
        said = [layout.sampling.get(channel) or layout.first_sampling for _, layout in run.file_segments]
        starts = [self._seconds_from_first(one) for one in said]
        if x is None:
            x0, step = [one.x0 for one in said], [one.step for one in said]
            number = np.arange(rows) - np.repeat(firsts, counts)
            number[: counts[0]] += before
            x = np.repeat(x0, counts) + np.repeat(step, counts) * number
        return np.where(np.abs(x) > DATED, x, x + np.repeat(starts, counts))

    def _seconds_from_first(self, one: Sampling) -> float:
        """From the start of the log to that of a file segment [s]; NaN where one has no date."""
        assert self.first is not None
        return float(one.start - self.first.start) if one.start is not None and self.first.start is not None else np.nan

    def _check_samples(self) -> None:
        """A header counts the samples of its write; without several headers, of the first write only."""
        if self.file_segment is None or self.file_segment.samples is None:
            return
        line, stated, rows = self.file_segment.line, self.file_segment.samples, self.rows_in_segment
        if rows < stated or (rows > stated and self.file_segment.file.several):
            self.say(f"line {line}: the header says {stated} samples, {rows} rows follow; these are read")

    def _close(self) -> None:
        """What is known only at the end of the file."""
        self._check_samples()
        walk, lines, say = self.walk, self.lines, self.say
        if self.rows and walk.layout is not self.file_segment:
            say(f"line {walk.line}: the file ends behind the header of a file segment, which holds no rows")
        if not self.rows:
            say("the file holds headers and no rows: the recorder stopped before its first write")
        if self.back:
            again = f" (the first of {self.back} times)" if self.back > 1 else ""
            say(f"{self.went_back}{again}; the rows are kept, and the channel {self.derived[0]!r} numbers the writes")
        if walk.narrow:
            say(f"line {walk.first_narrow}: the first of {walk.narrow} rows with too few cells, filled with nulls")
        for cells, line in sorted(walk.wide.items()):
            say(f"line {line}: rows of {cells} cells begin, more than the header names; see column_<number>")
        if lines.cut and self.walk.state == "row":
            self.log.dropped += 1
            say(f"line {lines.cut_at}: the file ends within this row, which is dropped")
        elif lines.cut:
            say(f"line {lines.cut_at}: the file ends within this line, which is not used")
        if lines.padding:
            say(f"{lines.padding} NUL bytes at the end of the file, as a power cut leaves them, are not read")
        if lines.damage:
            say(lines.damage)
        say.close()


class Remarks:
    """Adds to a list of warnings; those that differ in their numbers only are counted after the first few."""

    def __init__(self, warnings: list[str]) -> None:
        self.warnings = warnings
        self.kinds: Counter[str] = Counter()

    def __call__(self, remark: str) -> None:
        """Remark on something."""
        kind = NUMBERS.sub("#", remark)
        self.kinds[kind] += 1
        if self.kinds[kind] <= MOST:
            self.warnings.append(remark)

    def close(self) -> None:
        """Say how many were not told."""
        for kind, count in self.kinds.items():
            if count > MOST:
                self.warnings.append(f"{count - MOST} more times: {kind}")
