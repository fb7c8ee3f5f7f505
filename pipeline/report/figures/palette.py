"""The colours of the report, distinguishable without colour vision: Okabe and Ito, Color Universal Design (2008)."""

from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Protocol, TypeVar

from pipeline.report.content.marks import Colour

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
TURN: tuple[str, ...] = ("blue", "vermillion", "green", "purple", "orange", "sky", "black")


class Coloured(Protocol):
    """Any mark: it names a colour, or none."""

    @property
    def colour(self) -> Colour:
        """One of COLOURS, or ""."""


M = TypeVar("M", bound=Coloured)


def assign_colours(marks: Sequence[M]) -> Iterator[tuple[M, str]]:
    """Each mark with its colour; those that name none take turns."""
    turn = cycle(TURN)
    for mark in marks:
        yield mark, COLOURS[str(mark.colour) or next(turn)]
