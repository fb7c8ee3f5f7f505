"""Fitting tables to the page, by the widths that the letters of the report's font have."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from davinci_forces.report.content.inline import parse

PAGE = 482.0  # [pt] of the text on an A4 page
INSETS = (10.0, 6.0)  # [pt] between the columns, and where there is little room
SLACK = 0.6  # [em] that a column is wider than its letters
SIZES = (9.0, 8.5, 8.0)  # [pt]
LONG = 44  # letters that no line of prose has trouble with
HEAD_LINES = 3  # of a header, before the cells below it have to break
BOLD = 1.08  # how much wider the letters of a header are
CODE, SYMBOL, OTHER = 0.51, 0.6, 0.65  # [em] of a letter of code, of a sign of maths, of a letter not known here
LETTERS: dict[str, float] = {  # [em] of a letter, Libertinus Serif to a twentieth
    letter: width
    for width, letters in (
        (0.25, " \N{NO-BREAK SPACE}',.|:;ijl·°"),
        (0.3, "!()/IJ\\ft{}⁰¹²³⁴⁵⁶⁷⁸⁹⁻"),
        (0.35, '"*-[]r'),
        (0.4, "`sz"),
        (0.47, "#$0123456789?ace~τé"),
        (0.5, "FS^_bdgkopqvxyθµ"),
        (0.55, "+<=>ELPhnu±×−–σ"),
        (0.7, "&ADGNOQ"),
        (0.8, "Hmw"),
        (0.95, "M@W"),
    )
    for letter in letters
}
BREAK = "\N{ZERO WIDTH SPACE}"


@dataclass(frozen=True)
class FittedTable:
    """How a table is set: the letters [pt], the gap between columns [pt], each column's width [pt] (None: as wide as
    its words) and the letters after which a word in it may break."""

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
    """Width that a column wants [em]: with nothing broken, with its header in lines, and for its longest word."""

    whole: float
    headed: float
    word: float


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
    words, room = [want.word for want in wants], _room(size, inset, len(cells))
    return _set(size, inset, wants, words if sum(words) <= room else share_room(words, room))


def _room(size: float, inset: float, columns: int) -> float:
    """Width that all columns have together [em]."""
    return (PAGE - inset * columns) / size


def _set(size: float, inset: float, wants: list[Wants], least: list[float]) -> FittedTable:
    """Columns of these widths at least [em], what is left shared by those that want more."""
    left = _room(size, inset, len(wants)) - sum(least)
    more = share_room([max(want.whole - width, 0) for want, width in zip(wants, least, strict=True)], left)
    widths = [width + extra for width, extra in zip(least, more, strict=True)]
    letters = tuple(
        inf if width >= want.word - 1e-9 else max((width - SLACK) / CODE, 1)
        for width, want in zip(widths, wants, strict=True)
    )
    return FittedTable(size, inset, tuple(width * size + inset for width in widths), letters)


def _wants(column: list[str]) -> Wants:
    head, *cells = column
    head_words = [BOLD * width for width in _words(head)]
    head_width = BOLD * _width(head)
    widest = max(map(_width, cells), default=0)
    in_lines = max(*head_words, head_width / (HEAD_LINES - 1), 0) if head_words else 0
    whole = max(widest, head_width)
    word = max([width for text in cells for width in _words(text)] + head_words, default=0)
    return Wants(whole + SLACK, max(widest, min(in_lines, head_width)) + SLACK, min(word, whole) + SLACK)


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


def _width(text: str) -> float:
    """Width of a marked text on one line [em]."""
    return sum(_span_width(span.kind, span.text) for span in parse(text))


def _span_width(kind: str, text: str) -> float:
    if kind == "maths":  # prints fewer signs than it is written with
        return SYMBOL * len(re.sub(r"[a-z]{2,}|[^a-z]", "x", text))
    if kind == "code":
        return CODE * len(text)
    return sum(LETTERS.get(letter, OTHER) for letter in text) * (BOLD if kind == "bold" else 1)


def _words(text: str) -> list[float]:
    """Widths of the words of a text, which may not break [em]; words that different marks share break between them."""
    words: list[float] = []
    for span in parse(text):
        parts = [span.text] if span.kind == "maths" else re.findall(r"[^ \t\n]+", span.text)
        words += [_span_width(span.kind, part) for part in parts]
    return words
