"""Arrange the panels of a figure: all axes of one size, aligned, with room for the widest words next to them."""

from typing import TYPE_CHECKING

from davinci_forces.report.content import Figure
from davinci_forces.report.figures.panels import LINE_HEIGHT, draw_heading, make_room_for_names, plan_heading
from davinci_forces.report.figures.ticks import spread_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure as Canvas

PAGE_WIDTH = 170.0  # [mm] of the text on an A4 page
INCH = 25.4  # [mm]
DIGIT = 1.8  # [mm] width of a character of the numbers on an axis
TICK = 2.6  # [mm] from an axis to its numbers, and from the numbers to the label
RIGHT = 4.0  # [mm] right of the axes, room for half of the last number
NUMBERS = 3.4  # [mm] height of a line of numbers on an axis
ROW_ABOVE = 2 * LINE_HEIGHT + 1.5  # [mm] height of a heading with one line of title and one line of legend
MIN_AXES_HEIGHT = 15.0  # [mm]


def arrange(canvas: "Canvas", figure: Figure) -> None:
    """Put the axes of a figure in their places, with their headings; the canvas becomes as high as they need."""
    columns = figure.columns
    width = PAGE_WIDTH / columns
    rows = [canvas.axes[i : i + columns] for i in range(0, len(canvas.axes), columns)]
    for axes, panel in zip(canvas.axes, figure.panels, strict=True):  # drawing may change the numbers left of the axes
        make_room_for_names(axes, panel, max(figure.height - ROW_ABOVE - _room_below(axes), MIN_AXES_HEIGHT))
    numbers = max(_letters(axes.yaxis) for axes in canvas.axes) * DIGIT
    left = TICK + numbers + max(_lines(axes.get_ylabel()) for axes in canvas.axes) * LINE_HEIGHT + 1
    wide = width - left - RIGHT
    for axes in canvas.axes:
        spread_ticks(axes.xaxis, wide / DIGIT)
    headings = [plan_heading(panel, wide) for panel in figure.panels]
    rooms = [max(h.height for h in headings[i : i + columns]) for i in range(0, len(headings), columns)]
    below = [max(_room_below(axes) for axes in row) for row in rows]
    # The height that a figure asks for includes its words, with two lines of heading.
    asked = figure.height * len(rows) + sum(max(room - ROW_ABOVE, 0) for room in rooms)
    high = max((asked - sum(rooms) - sum(below)) / len(rows), MIN_AXES_HEIGHT)
    total = sum(rooms) + sum(below) + high * len(rows)
    canvas.set_size_inches(PAGE_WIDTH / INCH, total / INCH)
    bottom = total
    for i, (row, room) in enumerate(zip(rows, rooms, strict=True)):
        bottom -= room + high
        for j, axes in enumerate(row):
            axes.set_position(((j * width + left) / PAGE_WIDTH, bottom / total, wide / PAGE_WIDTH, high / total))
            # The place of a label is fixed; otherwise matplotlib would measure the numbers of every axis twice.
            axes.yaxis.set_label_coords(-(TICK + numbers) / wide, 0.5)
            axes.xaxis.set_label_coords(0.5, -(TICK + _lines_of_numbers(axes.xaxis) * NUMBERS) / high)
            draw_heading(axes, headings[i * columns + j], room, high)
        bottom -= below[i]


def _room_below(axes: "Axes") -> float:
    """Height of the numbers and the label below axes [mm]."""
    return TICK + _lines_of_numbers(axes.xaxis) * NUMBERS + _lines(axes.get_xlabel()) * LINE_HEIGHT + 0.5


def _numbers(axis: "Axis") -> list[str]:
    return axis.get_major_formatter().format_ticks(list(axis.get_majorticklocs()))


def _letters(axis: "Axis") -> int:
    return max((len(line) for number in _numbers(axis) for line in number.split("\n")), default=0)


def _lines_of_numbers(axis: "Axis") -> int:
    return max((_lines(number) for number in _numbers(axis)), default=1)


def _lines(text: str) -> int:
    return text.count("\n") + 1 if text else 0
