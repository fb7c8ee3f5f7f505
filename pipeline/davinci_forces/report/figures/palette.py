"""The looks of marks: colours that differ without colour vision, and line styles that differ without any colour."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Any, TypeVar

from davinci_forces.report.content.marks import Line, Line3D

PALETTE: dict[str, tuple[str, str]] = {  # on a light page, on a dark one
    # Of marks: Okabe and Ito, Color Universal Design (2008); on a dark page the same hues, lighter.
    "black": ("#1a1a1a", "#e8ecf0"),
    "blue": ("#0072b2", "#4ba3e3"),
    "vermillion": ("#d55e00", "#f2803a"),
    "green": ("#009e73", "#2fc498"),
    "orange": ("#e69f00", "#f0b429"),
    "sky": ("#56b4e9", "#85cdf5"),
    "purple": ("#cc79a7", "#e39cc4"),
    "yellow": ("#f0e442", "#f0e442"),
    "grey": ("#7a7a7a", "#9aa3ad"),
    # Of the surroundings of marks, by use; the same in every figure.
    "words": ("#222222", "#e4e8ed"),
    "axes": ("#555555", "#a3adb8"),
    "grid": ("#e4e4e4", "#2c343d"),
    "paper": ("#ffffff", "#14181d"),
}
COLOURS = {name: light for name, (light, _) in PALETTE.items()}  # before a page turns dark
WORDS, AXES, GRID = (COLOURS[part] for part in ("words", "axes", "grid"))
TURN = ("blue", "vermillion", "green", "purple", "orange", "sky", "black")
STYLES = ("solid", "dashed", "dotted", "dashdot")

M = TypeVar("M", bound=Any)


def assign_looks(marks: Sequence[M]) -> Iterator[M]:
    """Give each mark a colour and each line a style; marks that name none take the next in the palette."""
    colours, styles = cycle(TURN), cycle(STYLES)
    for mark in marks:
        look = {} if mark.colour else {"colour": next(colours)}
        if isinstance(mark, Line | Line3D) and not mark.style:
            look["style"] = next(styles)
        yield replace(mark, **look) if look else mark
