"""Lay out the panels of a figure: all axes of one size, aligned, with room for the widest words."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content import PAGE_WIDTH, Figure, Panel
from davinci_forces.report.content.marks import AnyMark, Bars, Histogram, Line, Line3D, Points, Points3D, Stems, Tiles
from davinci_forces.report.content.thinning import is_sorted, thin_mark
from davinci_forces.report.figures.palette import assign_looks
from davinci_forces.report.figures.shapes import LINE_HEIGHT
from davinci_forces.report.figures.ticks import Axis, axis_over

# Of one mark in a millimetre: finer than its lines and symbols are wide.
VERTICES, LOOP_VERTICES, SYMBOLS_PER_MM = 6, 30, 3
LETTER_WIDTH = 1.65  # [mm] width of a character of a label
SAMPLE = 12.0  # [mm] width of the sample before a legend entry, with the gaps around it
NAME = 3.6  # [mm] height of a point's name beside the point
ABOUT = 18.0  # [mm] of a panel's height for the words above and below the axes
DIGIT = 1.8  # [mm] width of a character of the numbers on an axis
TICK = 2.6  # [mm] from an axis to its numbers, and from the numbers to the label
RIGHT = 4.0  # [mm] right of the axes, room for half of the last number
NUMBERS = 3.4  # [mm] height of a line of numbers on an axis
ROW_ABOVE = 2 * LINE_HEIGHT + 1.5  # [mm] height of a heading with one line of title and one line of legend
MIN_AXES_HEIGHT = 15.0  # [mm]
X_MARGIN, SYMBOL_MARGIN, Y_MARGIN = 0.01, 0.03, 0.05  # shares of a range beyond its marks
NARROW, X_STEPS, FEW_X_STEPS, Y_STEPS = 70.0, 8, 4, 5  # [mm] a narrow panel; largest numbers of steps between ticks


@dataclass(frozen=True)
class Heading:
    """What stands above a panel: its title in lines, and each entry of its legend, with its place.

    A legend of one row stands beside the last line of the title if both fit.  One that holds for all panels of a row
    goes `across` them, above their titles.
    """

    title: str
    entries: tuple[tuple[str, float, int], ...]  # text, distance from the left [mm], lines below the first entry
    legend_lines: int
    across: bool = False

    @property
    def title_lines(self) -> int:
        """Lines of the title."""
        return lines_of(self.title) if self.title else 0

    @property
    def height(self) -> float:
        """Height of the whole heading [mm]."""
        return LINE_HEIGHT * (self.legend_lines + self.title_lines) + 1.5


@dataclass(frozen=True)
class PlacedPanel:
    """A panel with its marks as they are drawn, its axes, and their place on the page [mm], from the top left."""

    marks: tuple[AnyMark, ...]
    x: Axis
    y: Axis
    heading: Heading
    y_numbers: float  # width of the numbers left of the axes
    width: float
    left: float = 0.0
    top: float = 0.0
    height: float = 0.0

    @property
    def room_below(self) -> float:
        """Height of the numbers and the label below the axes [mm]."""
        return TICK + self.x.lines * NUMBERS + lines_of(self.x.label) * LINE_HEIGHT * bool(self.x.label) + 0.5


def plan_heading(title: str, marks: Sequence[AnyMark | Line3D | Points3D], room: float) -> Heading:
    """The heading of axes of this width [mm]."""
    labels = [mark.label for mark in marks if mark.label]
    widths = [SAMPLE + LETTER_WIDTH * len(label) for label in labels]
    columns = max(1, min(len(labels), int(room / max(widths, default=SAMPLE))))
    texts = [_wrap(label, room - SAMPLE) for label in labels]
    title = _wrap(title, 0.9 * room)  # bold letters are wider
    if title and columns == len(labels) and 1.2 * LETTER_WIDTH * len(title) + sum(widths) + 3 <= room:
        starts = accumulate(widths, initial=room - sum(widths))
        return Heading(title, tuple((text, x, -1) for text, x in zip(texts, starts, strict=False)), 0)
    # Entries that stand side by side have one line each.
    heights = [lines_of(text) if columns == 1 else int(k % columns == 0) for k, text in enumerate(texts)]
    rows = [sum(heights[: k - k % columns]) for k in range(len(texts))]
    entries = ((text, k % columns * max(widths), row) for k, (text, row) in enumerate(zip(texts, rows, strict=True)))
    return Heading(title, tuple(entries), sum(heights))


def lines_of(text: str) -> int:
    """Lines of a text."""
    return text.count("\n") + 1


def place_panels(figure: Figure) -> tuple[tuple[PlacedPanel, ...], float]:
    """The panels of a figure in their places, and the height of the figure [mm].

    The height that a figure asks for includes its words, with two lines of heading.
    """
    columns, width = figure.columns, PAGE_WIDTH / figure.columns
    drawn = [_marks_and_axes(figure, place, width) for place in range(len(figure.panels))]
    numbers = max(y.characters for _, _, y in drawn) * DIGIT
    left = TICK + numbers + max(lines_of(y.label) for _, _, y in drawn) * LINE_HEIGHT + 1
    wide = width - left - RIGHT
    panels = [
        PlacedPanel(marks, _numbered(x, width, wide), y, plan_heading(panel.title, marks, wide), numbers, wide)
        for panel, (marks, x, y) in zip(figure.panels, drawn, strict=True)
    ]
    rows = [_sharing_legend(panels[i : i + columns], left) for i in range(0, len(panels), columns)]
    above = [max(panel.heading.height for panel in row) for row in rows]
    below = [max(panel.room_below for panel in row) for row in rows]
    asked = figure.height * len(rows) + sum(max(room - ROW_ABOVE, 0) for room in above)
    high = max((asked - sum(above) - sum(below)) / len(rows), MIN_AXES_HEIGHT)
    placed, top = list[PlacedPanel](), 0.0
    for row, over, under in zip(rows, above, below, strict=True):
        top += over
        placed += [replace(panel, left=j * width + left, top=top, height=high) for j, panel in enumerate(row)]
        top += high + under
    return tuple(placed), top


def _sharing_legend(row: list[PlacedPanel], left: float) -> list[PlacedPanel]:
    """The panels of a row; if the first one alone has a legend, that goes across all."""
    first, *others = row
    if not others or not first.heading.entries or any(panel.heading.entries for panel in others):
        return row
    legend = plan_heading("", first.marks, PAGE_WIDTH - left)
    return [replace(first, heading=replace(legend, title=first.heading.title, across=True)), *others]


def _marks_and_axes(figure: Figure, place: int, width: float) -> tuple[tuple[AnyMark, ...], Axis, Axis]:
    """The marks of a panel as they are drawn, and its axes; the horizontal one may have no numbers yet."""
    panel = figure.panels[place]
    marks = tuple(thin_mark(mark, max_points(mark, width)) for mark in assign_looks(panel.marks))
    sharing = figure.panels if figure.zoomable else (panel,)
    is_last = place + figure.columns >= len(figure.panels)
    label = panel.x_label if is_last or not figure.zoomable else ""
    x, y = _across(sharing, label), _up(panel, figure.height)
    names = next((mark.names for mark in marks if isinstance(mark, Bars | Tiles)), ())
    if any(isinstance(mark, Tiles) for mark in marks):
        n = len(names)
        x = replace(x, low=-0.5, high=n - 0.5).with_names([name.partition(" ")[0] for name in names])
        y = Axis(n - 0.5, -0.5, log=False, label=panel.y_label).with_names(names)
    elif names:
        x = x.with_names(names)
    elif panel.x_dates:
        x = x.with_dates(FEW_X_STEPS)
    return marks, x, y


def _across(panels: Sequence[Panel], label: str) -> Axis:
    """The horizontal axis that panels share."""
    marks = [mark for panel in panels for mark in panel.marks]
    margin = SYMBOL_MARGIN if any(isinstance(mark, Points | Stems) for mark in marks) else X_MARGIN
    stated = [panel.x_range for panel in panels if panel.x_range]
    columns = list(map(np.array, stated)) or [x for mark in marks for x in _extent(mark)[0]]
    return axis_over(columns, (0.0, 0.0) if stated else (margin, margin), panels[0].x_log, label)


def _up(panel: Panel, height: float) -> Axis:
    """The vertical axis, with room for the names of points, and with its numbers."""
    label = wrap_label(panel.y_label, height - ABOUT)
    if panel.y_range:
        return axis_over([np.array(panel.y_range)], (0.0, 0.0), panel.y_log, label).with_numbers(Y_STEPS)
    columns = [y for mark in panel.marks for y in _extent(mark)[1]]
    names = any(isinstance(mark, Points) and mark.names for mark in panel.marks)
    margin = Y_MARGIN + (0.5 * NAME / max(height - ROW_ABOVE - ABOUT / 2, 4.0 * NAME) if names else 0.0)
    stands = any(isinstance(mark, Bars | Histogram) for mark in panel.marks)
    stands = stands and all(np.nanmin(y, initial=0.0) >= 0 for y in columns)
    axis = axis_over(columns, (0.0 if stands else margin, margin), panel.y_log, label).with_numbers(Y_STEPS)
    return replace(axis, label=wrap_label(" ".join(axis.label.split()), height - ABOUT))


def _extent(mark: AnyMark) -> tuple[list[Array], list[Array]]:
    """The values of x and of y that axes show of a mark."""
    x, y = (
        [np.atleast_1d(getattr(mark, name)) for name in names if hasattr(mark, name)]
        for names in (("x", "edges", "start", "end"), ("y", "lower", "upper", "heights", "counts"))
    )
    if isinstance(mark, Points) and mark.y_std is not None:
        y = [mark.y - mark.y_std, mark.y + mark.y_std]
    if isinstance(mark, Stems | Histogram | Bars):
        y.append(np.zeros(1))
    return [np.array([-0.5, len(mark.names) - 0.5])] if isinstance(mark, Bars) else x, y


def _numbered(x: Axis, width: float, wide: float) -> Axis:
    """The horizontal axis of a panel with its numbers and label; axes are `wide` and the panel `width` [mm]."""
    x = x if x.values else x.with_numbers(FEW_X_STEPS if width < NARROW else X_STEPS, wide / DIGIT)
    return replace(x, label=wrap_label(x.label, width - 18))


def max_points(mark: AnyMark, width: float) -> int:
    """The number of points beyond which further points are not visible in a panel of this width [mm]."""
    if isinstance(mark, Points | Stems):
        return round(SYMBOLS_PER_MM * width)
    return round((VERTICES if not isinstance(mark, Line) or is_sorted(mark.x) else LOOP_VERTICES) * width)


def wrap_label(label: str, room: float) -> str:
    """An axis label in lines that fit into `room` [mm], the unit on a line of its own where that is enough."""
    meaning, bracket, unit = label.rpartition(" [")
    if not meaning or len(label) * LETTER_WIDTH <= room:
        return _wrap(label, room)
    return f"{_wrap(meaning, room)}\n{bracket.strip()}{unit}"


def _wrap(text: str, room: float) -> str:
    return textwrap.fill(text, max(int(room / LETTER_WIDTH), 1), break_long_words=False, break_on_hyphens=False)
