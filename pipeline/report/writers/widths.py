"""Fitting tables to the page: character counts stand for widths, generously, so that nothing runs over the edge."""

import re
from dataclasses import dataclass
from math import inf

from pipeline.report.content.inline import Span, parse

PAGE = 482.0  # [pt] of the text on an A4 page
INSET = 10.0  # [pt] between the columns
EM = 0.5  # mean width of a letter [em]: digits and most words are narrower, capitals wider
SLACK = 2  # letters that a column may be wider than its mean letters say
SIZES = (9.0, 8.0, 7.0, 6.0)  # [pt]
LONG = 44  # letters that no line of prose has trouble with
BREAK = "\N{ZERO WIDTH SPACE}"


@dataclass(frozen=True)
class FittedTable:
    """How a table is set: the letters [pt], and each column's width [pt] (None: as wide as its words) and letters."""

    size: float
    widths: tuple[float | None, ...]
    letters: tuple[float, ...]

    def cell(self, column: int, text: str) -> list[dict[str, str]]:
        """The spans of a cell, its words breakable where the column is narrower than they are."""
        room = self.letters[column]
        return [
            span._asdict()
            | ({} if room == inf or span.kind == "maths" else {"text": allow_breaks(span.text, int(room))})
            for span in parse(text)
        ]


def fit_columns(cells: list[list[str]]) -> FittedTable:
    """The largest letters at which the columns fit as they are; else columns that share the page, in smaller ones."""
    natural = [max(map(_letters, column), default=0) + SLACK for column in cells]
    for size in SIZES[:2]:
        if sum(natural) * EM * size + INSET * len(natural) <= PAGE:
            return FittedTable(size, (None,) * len(natural), (inf,) * len(natural))
    longest = [max((len(word) for text in column for word in _split_words(text)), default=0) for column in cells]
    for size in SIZES[1:]:
        room = (PAGE - INSET * len(natural)) / (EM * size)
        letters = share_room(natural, room)
        if size == SIZES[-1] or all(width >= min(word, 14) for width, word in zip(letters, longest, strict=True)):
            break
    return FittedTable(size, tuple(n * EM * size + INSET for n in letters), tuple(max(n - SLACK, 1) for n in letters))


def share_room(wanted: list[int], room: float) -> list[float]:
    """Room for each: what it wants while that is below an equal share of what the greedier ones leave."""
    shares, left = [0.0] * len(wanted), room
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    for rank, i in enumerate(order):
        equal = left / (len(order) - rank)
        shares[i] = min(float(wanted[i]), equal) if rank < len(order) - 1 else equal
        left -= shares[i]
    return shares


def allow_breaks(text: str, longest: int = LONG) -> str:
    """Allow words longer than `longest` to break: after a sign that separates parts of a name, or anywhere."""

    def cut(match: re.Match[str]) -> str:
        parts = re.findall(rf"[^/\\._-]{{1,{longest}}}[/\\._-]?|.", match[0])
        return BREAK.join(parts)

    return re.sub(rf"\S{{{longest + 1},}}", cut, text)


def _letters(text: str) -> int:
    return sum(_length(span) for span in parse(text))


def _length(span: Span) -> int:
    """Letters of a span; maths prints fewer than it is written with."""
    return len(span.text) if span.kind != "maths" else len(re.sub(r"[a-z]{2,}|[^a-z]", "x", span.text))


def _split_words(text: str) -> list[str]:
    return [word for span in parse(text) if span.kind != "maths" for word in span.text.split()]
