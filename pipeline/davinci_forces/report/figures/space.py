"""Draw lines and points in space: a cube with equal axes, seen along parallel rays from in front, right and above."""

from math import cos, hypot, radians, sin
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content import PAGE_WIDTH, Figure3D
from davinci_forces.report.content.marks import Line3D, Points3D
from davinci_forces.report.figures.draw import dots, stroke
from davinci_forces.report.figures.palette import AXES, COLOURS, GRID, WORDS
from davinci_forces.report.figures.shapes import NORMAL_SIZE, POINT, SMALL_SIZE, path, symbols, trace, words
from davinci_forces.report.figures.ticks import in_digits, round_values

MAX_STEPS = 4  # largest number of steps between the numbers of an axis
CURVE_WIDTH, PLACE_SIZE = 1.4, 4.0  # [pt]
AROUND = 1.1  # size of the cube over the largest range of the marks
NUMBER_GAP, LABEL_GAP = 11.0, 30.0  # [pt] from an edge of the cube to its numbers and its label
HALF_LETTER = 0.35  # half the width of a letter and the space around it, over its size
HEAD, HALF_ANGLE = 4.0, 0.45  # [pt], [rad] length and half the angle of the head of an arrow
AZIMUTH, ELEVATION = radians(-60.0), radians(20.0)  # of the reader
SCREEN = np.array(  # (2, 3) directions to the right and up
    [
        [-sin(AZIMUTH), cos(AZIMUTH), 0.0],
        [-cos(AZIMUTH) * sin(ELEVATION), -sin(AZIMUTH) * sin(ELEVATION), cos(ELEVATION)],
    ]
)
# Of the cube, from -1 to 1 along each axis: its sides behind the marks, and the middles of its edges with numbers.
BEHIND = np.array([-1.0, 1.0, -1.0])
EDGES = np.array([[0.0, -1.0, -1.0], [1.0, 0.0, -1.0], [-1.0, -1.0, 0.0]])
LABELS = ("x [m]", "y [m]", "z [m]")


class View(NamedTuple):
    """A cube on the page: its middle (3,) and half its edge in space, and both on the page [pt]."""

    middle: Array
    half: float
    centre: tuple[float, float]
    scale: float

    def place(self, points: Array) -> tuple[Array, Array]:
        """Points (..., 3) in space, as places on the page [pt]."""
        return self.place_in_cube((points - self.middle) / self.half)

    def place_in_cube(self, points: Array) -> tuple[Array, Array]:
        """Points (..., 3) of the cube, from -1 to 1 along each axis, as places on the page [pt]."""
        right, up = np.moveaxis(points @ SCREEN.T, -1, 0) * self.scale
        return self.centre[0] + right, self.centre[1] - up


def view_of(figure: Figure3D, top: float) -> View:
    """The view of a figure in its place below `top` [mm]."""
    points = np.hstack([[mark.x, mark.y, mark.z] for mark in figure.marks])
    least, greatest = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    half = AROUND / 2 * max(float(np.max(greatest - least)), 1e-9)
    right, up = np.abs(SCREEN).sum(axis=1)  # of the farthest corners
    width, high = PAGE_WIDTH * POINT, (figure.height - top) * POINT - LABEL_GAP - NORMAL_SIZE  # above the lower labels
    scale = min((width / 2 - 2 * LABEL_GAP) / right, high / 2 / up)
    return View((least + greatest) / 2, half, (width / 2, top * POINT + high / 2), float(scale))


def draw_space(figure: Figure3D, marks: tuple[Line3D | Points3D, ...], top: float) -> str:
    """Cube and marks of a figure, below `top` [mm]."""
    view = view_of(figure, top)
    return "".join(draw_axis(view, axis) for axis in range(3)) + "".join(
        draw_line(mark, view) if isinstance(mark, Line3D) else draw_points(mark, view) for mark in marks
    )


def draw_axis(view: View, axis: int) -> str:
    """Grid lines on the two sides behind the marks that an axis runs along, and its numbers and label at an edge."""
    low, along, edge = float(view.middle[axis] - view.half), np.eye(3)[axis], EDGES[axis]
    values, step = round_values(low, low + 2 * view.half, MAX_STEPS)
    shares = ((values - view.middle[axis]) / view.half)[:, None] * along
    others = [i for i in range(3) if i != axis]
    grid = "".join(
        _segment(view, share + BEHIND * np.eye(3)[fixed], free)
        for share in shares
        for fixed, free in (others, others[::-1])
    )
    svg = path(grid, stroke(GRID, 0.5)) + path(_segment(view, edge, axis), stroke(AXES, 0.6))
    # On the page, from the middle of the cube to the edge and across it.
    outwards, direction = SCREEN @ edge, SCREEN @ along
    outwards -= direction * (outwards @ direction) / (direction @ direction)
    outwards /= np.linalg.norm(outwards)
    numbers = in_digits(values, step)
    for share, number in zip(shares, numbers, strict=True):
        svg += _words(view, edge + share, NUMBER_GAP * outwards, number, SMALL_SIZE)
    # Beside an upright edge, the label stands off by half of its own width and of the longest number's.
    wide = abs(outwards[0]) * HALF_LETTER * (SMALL_SIZE * max(map(len, numbers)) + NORMAL_SIZE * len(LABELS[axis]))
    return svg + _words(view, edge, max(LABEL_GAP, NUMBER_GAP + wide) * outwards, LABELS[axis], NORMAL_SIZE)


def _segment(view: View, point: Array, axis: int) -> str:
    """The path through a point of the cube along one axis, from side to side."""
    along = np.eye(3)[axis]
    return trace(*view.place_in_cube(point + np.array([-along, along])))


def _words(view: View, point: Array, shift: Array, text: str, size: float) -> str:
    x, y = (float(side) for side in view.place_in_cube(point))
    return words(x + shift[0], y - shift[1] + 0.35 * size, text, WORDS, size, "middle")


def draw_line(mark: Line3D, view: View) -> str:
    """A curve; each stretch of an arrow has a head at its end."""
    x, y = view.place(np.stack([mark.x, mark.y, mark.z], axis=1))
    svg = path(trace(x, y), stroke(COLOURS[mark.colour], CURVE_WIDTH, mark.style))
    known = np.isfinite(np.r_[x + y, np.nan])
    ends = (np.flatnonzero(known[1:-1] & known[:-2] & ~known[2:]) + 1).tolist() if mark.arrow else []
    return svg + path("".join(_head(x[i - 1 : i + 1], y[i - 1 : i + 1]) for i in ends), stroke(COLOURS[mark.colour]))


def _head(x: Array, y: Array) -> str:
    """The head of an arrow from its first to its second point [pt]; none on a shorter arrow."""
    dx, dy = float(x[0] - x[1]), float(y[0] - y[1])
    if hypot(dx, dy) < HEAD:
        return ""
    back = HEAD * complex(dx, dy) / hypot(dx, dy)
    a, b = (back * complex(cos(angle), sin(angle)) for angle in (HALF_ANGLE, -HALF_ANGLE))
    return trace(x[1] + np.array([a.real, 0.0, b.real]), y[1] + np.array([a.imag, 0.0, b.imag]))


def draw_points(mark: Points3D, view: View) -> str:
    """Symbols with their names."""
    x, y = view.place(np.stack([mark.x, mark.y, mark.z], axis=1))
    svg = path(symbols(x, y), dots(COLOURS[mark.colour], PLACE_SIZE))
    return svg + "".join(
        words(a + PLACE_SIZE, b + 0.35 * NORMAL_SIZE, name, WORDS, NORMAL_SIZE)
        for a, b, name in zip(x.tolist(), y.tolist(), mark.names, strict=False)
    )
