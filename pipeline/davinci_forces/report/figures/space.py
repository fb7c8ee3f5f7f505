"""Draw lines and points in space: a cube with equal axes, seen along parallel rays."""

from itertools import product
from math import cos, hypot, radians, sin
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content import Figure3D
from davinci_forces.report.content.marks import Line3D, Points3D
from davinci_forces.report.figures.draw import dots, stroke
from davinci_forces.report.figures.palette import AXES, COLOURS, GRID, WORDS
from davinci_forces.report.figures.shapes import NORMAL_SIZE, POINT, SMALL_SIZE, path, symbols, trace, words
from davinci_forces.report.figures.ticks import in_digits, round_values

MAX_STEPS = 4  # largest number of steps between the numbers of an axis
CURVE_WIDTH, PLACE_SIZE = 1.4, 4.0  # [pt]
AROUND = 1.1  # size of the cube over the largest range of the marks
NUMBER_GAP, LABEL_GAP = 11.0, 30.0  # [pt] from an edge of the cube to its numbers and its label
HEAD, HALF_ANGLE = 4.0, 0.45  # [pt], [rad] length and half the angle of the head of an arrow


class View(NamedTuple):
    """A cube on the page: its middle (3,) and half its edge in space, its middle [pt] on the page, and the scale."""

    middle: Array
    half: float
    screen: Array  # (2, 3) directions to the right and up
    camera: Array  # (3,) direction to the reader
    centre: tuple[float, float]
    scale: float  # [pt] for a unit of length

    def place(self, points: Array) -> tuple[Array, Array]:
        """Points (..., 3) on the page [pt]."""
        right, up = np.moveaxis((points - self.middle) @ self.screen.T, -1, 0) * self.scale
        return self.centre[0] + right, self.centre[1] - up

    def side(self, axis: int, front: bool) -> float:
        """The coordinate of the side of the cube that faces the reader, or of the opposite side."""
        towards = 1.0 if self.camera[axis] >= 0 else -1.0
        return float(self.middle[axis] + (towards if front else -towards) * self.half)


def view_of(figure: Figure3D, width: float, height: float, top: float) -> View:
    """The view of a figure in a place of this width and height [pt] below `top`."""
    points = np.hstack([[mark.x, mark.y, mark.z] for mark in figure.marks])
    least, greatest = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    half = AROUND / 2 * max(float(np.max(greatest - least)), 1e-9)
    azimuth, elevation = radians(figure.azimuth), radians(figure.elevation)
    screen = np.array(
        [
            [-sin(azimuth), cos(azimuth), 0.0],
            [-cos(azimuth) * sin(elevation), -sin(azimuth) * sin(elevation), cos(elevation)],
        ]
    )
    camera = np.array([cos(azimuth) * cos(elevation), sin(azimuth) * cos(elevation), sin(elevation)])
    corners = np.array(list(product((-half, half), repeat=3))) @ screen.T
    reach = corners.max(axis=0)
    below = LABEL_GAP + NORMAL_SIZE  # the labels of the lower edges
    scale = min((width / 2 - 2 * LABEL_GAP) / reach[0], (height - below) / 2 / reach[1])
    return View((least + greatest) / 2, half, screen, camera, (width / 2, top + (height - below) / 2), float(scale))


def draw_space(figure: Figure3D, marks: tuple[Line3D | Points3D, ...], width: float, top: float) -> str:
    """Cube and marks of a figure that is `width` wide, below `top` [mm]."""
    view = view_of(figure, width * POINT, (figure.height - top) * POINT, top * POINT)
    labels = (figure.x_label, figure.y_label, figure.z_label)
    return "".join(draw_axis(view, i, label) for i, label in enumerate(labels)) + "".join(
        draw_line(mark, view) if isinstance(mark, Line3D) else draw_points(mark, view) for mark in marks
    )


def draw_axis(view: View, axis: int, label: str) -> str:
    """Grid lines on the two sides behind the marks that an axis runs along, and its numbers and label at an edge."""
    low = float(view.middle[axis] - view.half)
    values, step = round_values(low, low + 2 * view.half, MAX_STEPS)
    others = [i for i in range(3) if i != axis]
    grid = "".join(
        _segment(view, {axis: value, fixed: view.side(fixed, front=False)}, free)
        for value in values.tolist()
        for fixed, free in (others, others[::-1])
    )
    edge = _edge(view, axis)
    svg = path(grid, stroke(GRID, 0.5)) + path(_segment(view, edge, axis), stroke(AXES, 0.6))
    outwards = _outwards(view, edge, axis)
    for value, number in zip(values.tolist(), in_digits(values, step), strict=True):
        svg += _words(view, {**edge, axis: value}, outwards, NUMBER_GAP, number, SMALL_SIZE)
    return svg + _words(view, {**edge, axis: float(view.middle[axis])}, outwards, LABEL_GAP, label, NORMAL_SIZE)


def _edge(view: View, axis: int) -> dict[int, float]:
    """The edge of the cube at which the numbers of an axis stand: at the bottom in front, or the leftmost one."""
    if axis < 2:
        return {1 - axis: view.side(1 - axis, front=True), 2: float(view.middle[2] - view.half)}
    corners = [{0: view.side(0, front), 1: view.side(1, not front)} for front in (True, False)]
    return min(corners, key=lambda corner: float(view.place(_point(view, corner))[0]))


def _point(view: View, coordinates: dict[int, float]) -> Array:
    """A point with these coordinates, and those of the cube's middle."""
    return np.array([coordinates.get(i, float(view.middle[i])) for i in range(3)])


def _segment(view: View, coordinates: dict[int, float], free: int) -> str:
    """The path along one coordinate through the cube."""
    ends = [_point(view, {**coordinates, free: float(view.middle[free]) + side * view.half}) for side in (-1, 1)]
    return trace(*view.place(np.array(ends)))


def _outwards(view: View, edge: dict[int, float], axis: int) -> tuple[float, float]:
    """The direction on the page from the middle of the cube to an edge, across the edge."""
    x, y = (float(side) for side in view.place(_point(view, edge)))
    along = view.screen[:, axis]
    across = np.array([x - view.centre[0], view.centre[1] - y])
    if hypot(*along) > 0:
        across -= along * (across @ along) / (along @ along)
    length = hypot(*across) or 1.0
    return float(across[0] / length), float(-across[1] / length)


def _words(
    view: View, coordinates: dict[int, float], outwards: tuple[float, float], gap: float, text: str, size: float
) -> str:
    x, y = (float(side) for side in view.place(_point(view, coordinates)))
    return words(x + gap * outwards[0], y + gap * outwards[1] + 0.35 * size, text, WORDS, size, "middle")


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
    sides = [(cos(a) * dx - sin(a) * dy, sin(a) * dx + cos(a) * dy) for a in (HALF_ANGLE, -HALF_ANGLE)]
    (a, b), (c, d) = ((HEAD / hypot(dx, dy) * u, HEAD / hypot(dx, dy) * v) for u, v in sides)
    return trace(np.array([x[1] + a, x[1], x[1] + c]), np.array([y[1] + b, y[1], y[1] + d]))


def draw_points(mark: Points3D, view: View) -> str:
    """Symbols with their names."""
    x, y = view.place(np.stack([mark.x, mark.y, mark.z], axis=1))
    svg = path(symbols(x, y), dots(COLOURS[mark.colour], PLACE_SIZE))
    return svg + "".join(
        words(a + PLACE_SIZE, b + 0.35 * NORMAL_SIZE, name, WORDS, NORMAL_SIZE)
        for a, b, name in zip(x.tolist(), y.tolist(), mark.names, strict=False)
    )
