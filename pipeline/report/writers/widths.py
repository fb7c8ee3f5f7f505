"""Fitting tables to the page: character counts stand for widths, generously, so that nothing runs over the edge."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf

from pipeline.report.content.inline import Span, parse

PAGE = 482.0  # [pt] of the text on an A4 page
INSETS = (10.0, 6.0)  # [pt] between the columns, and where there is little room
EM = 0.5  # mean width of a letter [em]: digits and most words are narrower, capitals wider
SLACK = 2  # letters that a column may be wider than its mean letters say
SIZES = (9.0, 8.5, 8.0)  # [pt]
LONG = 44  # letters that no line of prose has trouble with
HEAD_LINES = 3  # of a header, before the cells below it have to break
BOLD = 1.1  # how much wider the letters of a header are
BREAK = "\N{ZERO WIDTH SPACE}"


@dataclass(frozen=True)
class FittedTable:
    """How a table is set: the letters [pt], the gap between columns [pt], each column's width [pt] (None: as wide as
    its words) and letters."""

    size: float
    inset: float
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


@dataclass(frozen=True)
class Wants:
    """Letters that a column wants: with nothing broken, with its header in lines, and for its longest word."""

    whole: int
    headed: int
    word: int


def fit_columns(cells: list[list[str]]) -> FittedTable:
    """The largest letters at which columns, each with its header first, fit; in the smallest, cells may break."""
    wants = [_wants(column) for column in cells]
    for size in SIZES:
        if sum(want.whole for want in wants) <= _room(size, INSETS[0], len(cells)):
            return FittedTable(size, INSETS[0], (None,) * len(cells), (inf,) * len(cells))
    for inset in INSETS:
        for size in SIZES:
            if sum(want.headed for want in wants) <= _room(size, inset, len(cells)):
                return _set(size, inset, wants, [want.headed for want in wants])
    size, inset = SIZES[-1], INSETS[-1]
    words = [want.word for want in wants]
    if sum(words) > _room(size, inset, len(cells)):
        return _set(size, inset, wants, share_room(words, _room(size, inset, len(cells))))
    return _set(size, inset, wants, words)


def _room(size: float, inset: float, columns: int) -> float:
    """Letters that all columns have together."""
    return (PAGE - inset * columns) / (EM * size)


def _set(size: float, inset: float, wants: list[Wants], letters: list[float] | list[int]) -> FittedTable:
    """Columns of so many letters at least, what is left shared by those that want more."""
    left = _room(size, inset, len(wants)) - sum(letters)
    more = share_room([max(want.whole - given, 0) for want, given in zip(wants, letters, strict=True)], left)
    given = [least + extra for least, extra in zip(letters, more, strict=True)]
    rooms = tuple(inf if g >= want.word else max(g - SLACK, 1) for g, want in zip(given, wants, strict=True))
    return FittedTable(size, inset, tuple(g * EM * size + inset for g in given), rooms)


def _wants(column: list[str]) -> Wants:
    head, *cells = column
    words = max((len(word) for text in cells for word in _split_words(text)), default=0)
    head_word = max((ceil(BOLD * len(word)) for word in _split_words(head)), default=0)
    head_letters = ceil(BOLD * _letters(head))
    widest = max(map(_letters, cells), default=0)
    in_lines = max(head_word, ceil(head_letters / HEAD_LINES))
    whole, headed, word = max(widest, head_letters), max(widest, in_lines), max(words, head_word)
    return Wants(whole + SLACK, min(headed, whole) + SLACK, min(word, whole) + SLACK)


def share_room(wanted: Sequence[float], room: float) -> list[float]:
    """Room for each: what it wants while that is below an equal share of what the greedier ones leave."""
    shares, left = [0.0] * len(wanted), room
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    for rank, i in enumerate(order):
        shares[i] = min(float(wanted[i]), left / (len(order) - rank))
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
