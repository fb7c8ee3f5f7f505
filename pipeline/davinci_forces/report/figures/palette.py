"""The looks of marks: colours that differ without colour vision, and line styles that differ without any colour."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Any, TypeVar

from davinci_forces.report.content.marks import Line, Line3D

# Okabe and Ito, Color Universal Design (2008); on a dark page the same hues, lighter.
COLOURS: dict[str, str] = {
    "black": "#1a1a1a",
    "blue": "#0072b2",
    "vermillion": "#d55e00",
    "green": "#009e73",
    "orange": "#e69f00",
    "sky": "#56b4e9",
    "purple": "#cc79a7",
    "yellow": "#f0e442",
    "grey": "#7a7a7a",
}
DARK: dict[str, str] = {
    "black": "#e8ecf0",
    "blue": "#4ba3e3",
    "vermillion": "#f2803a",
    "green": "#2fc498",
    "orange": "#f0b429",
    "sky": "#85cdf5",
    "purple": "#e39cc4",
    "yellow": "#f0e442",
    "grey": "#9aa3ad",
}
# Colours of the surroundings of marks, by use; the same in every figure.
SURROUNDINGS: dict[str, tuple[str, str]] = {  # on a light page, on a dark one
    "words": ("#222222", "#e4e8ed"),
    "axes": ("#555555", "#a3adb8"),
    "grid": ("#e4e4e4", "#2c343d"),
    "paper": ("#ffffff", "#14181d"),
}
WORDS, AXES, GRID = (SURROUNDINGS[part][0] for part in ("words", "axes", "grid"))  # before a page turns dark
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
