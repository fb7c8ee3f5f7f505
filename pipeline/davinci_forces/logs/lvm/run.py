"""Consecutive rows of a LabVIEW measurement file that have the same columns."""

import re
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.logs.lvm.header import END, Layout

WRITTEN = re.compile(rb"-?\d+[.,]\d+(E[+-]?\d+)?|NaN|-?Inf")  # as LabVIEW writes a number: always with a fraction


@dataclass
class Run:
    """Consecutive rows with the same columns, of one or more file segments, all of `width` cells."""

    layout: Layout  # of the first file segment
    width: int
    first: int  # line of its first row
    block: bytes = b""
    commented: bool = False  # the last cell of every row is for a comment
    lines: list[int] | None = None  # line of each row, where they are not consecutive
    begins: list[int] = field(default_factory=list)  # rows at which a write begins, by what stands before them
    comments: list[tuple[int, bytes]] = field(default_factory=list)  # with their lines
    file_segments: list[tuple[int, Layout]] = field(default_factory=list)  # the row that each begins at

    def line(self, row: int) -> int:
        """The line that a row stands on."""
        return self.lines[row] if self.lines is not None else self.first + row

    def name(self, column: int) -> str:
        """The channel of a column; beyond the layout's, one of its number."""
        return self.layout.names[column] if column < self.layout.width else f"column_{column}"

    def looks_whole(self, lines: int) -> bool | None:
        """Whether the count of separators is that of so many rows, and no header ends in the block; None for no."""
        separators = int(np.count_nonzero(np.frombuffer(self.block, np.uint8) == ord(self.layout.file.separator)))
        headed = b"*" in self.block and END in self.block  # one letter is found far faster than a word
        return (separators == lines * (self.width - 1) and not headed) or None
