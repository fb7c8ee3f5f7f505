"""Draw each mark of a panel as SVG: one case per mark."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content import marks
from davinci_forces.report.content.number import in_format
from davinci_forces.report.figures.palette import AXES, COLOURS, WORDS
from davinci_forces.report.figures.shapes import SMALL_SIZE, path, symbols, trace, words
from davinci_forces.report.figures.ticks import Axis

LINE_WIDTH, THIN_WIDTH = 0.9, 0.5  # [pt] widths of lines
DASH_LENGTHS = {"dashed": "3.6,1.5", "dotted": "0.9,1.3", "dashdot": "4.5,1.3,0.9,1.3"}
OPACITIES = {marks.Band: 0.25, marks.HBand: 0.22, marks.VSpan: 0.18, marks.Histogram: 0.75}
SYMBOL_SIZE, BAR_END = 2.6, 2.0  # [pt] diameter of a point, half-width of the ends of an error bar
MANY = 60  # more stems than this are thin and have no heads, so that marks behind them stay visible
BARS_WIDTH, BAR_SHARE = 0.8, 0.92  # of the distance of two names: all bars of a name; of its place: one bar
TILE = 0.96  # of its place: one tile
BESIDE = 4.0  # [pt] from a point to its name


class Frame(NamedTuple):
    """The place of a pair of axes [pt], from the top left corner."""

    x: Axis
    y: Axis
    left: float
    top: float
    width: float
    height: float

    def place_x(self, x: Array | Sequence[float]) -> Array:
        """Values of x as places [pt]."""
        return self.left + self.width * self.x.share(x)

    def place_y(self, y: Array | Sequence[float]) -> Array:
        """Values of y as places [pt]."""
        return self.top + self.height * (1.0 - self.y.share(y))

    def outline(self, x: Array | Sequence[float], y: Array | Sequence[float], closed: bool = False) -> str:
        """The path through values."""
        return trace(self.place_x(x), self.place_y(y), closed)

    def box(self, left: float, right: float, low: float, high: float) -> str:
        """The path round a rectangle of values; an infinite end is that of the axes."""
        xs = np.clip([left, right], min(self.x.low, self.x.high), max(self.x.low, self.x.high))
        ys = np.clip([low, high], min(self.y.low, self.y.high), max(self.y.low, self.y.high))
        return self.outline(xs[[0, 1, 1, 0]], ys[[0, 0, 1, 1]], closed=True)


def stroke(colour: str, width: float = LINE_WIDTH, style: str = "solid") -> str:
    """The style of a line."""
    dashes = f"; stroke-dasharray: {DASH_LENGTHS[style]}" if style in DASH_LENGTHS else ""
    return f"fill: none; stroke: {colour}; stroke-width: {width:g}{dashes}"


def dots(colour: str, size: float = SYMBOL_SIZE) -> str:
    """The style of a path whose points are symbols."""
    return f"fill: none; stroke: {colour}; stroke-width: {size:g}; stroke-linecap: round"


def fill(colour: str, opacity: float) -> str:
    """The style of an area."""
    return f"fill: {colour}; fill-opacity: {opacity:g}; stroke: none"


def draw_mark(mark: marks.AnyMark, frame: Frame) -> tuple[str, str]:
    """A mark behind the lines and in front of them, as SVG."""
    colour = COLOURS[mark.colour]
    match mark:
        case marks.Line():
            return "", path(frame.outline(mark.x, mark.y), stroke(colour, style=mark.style))
        case marks.Points():
            return "", draw_points(mark, frame)
        case marks.Band():
            x, y = np.r_[mark.x, mark.x[::-1]], np.r_[mark.upper, mark.lower[::-1]]
            return path(frame.outline(x, y, closed=True), fill(colour, OPACITIES[marks.Band])), ""
        case marks.Stems():
            return "", draw_stems(mark, frame)
        case marks.Histogram():
            x, y = np.repeat(mark.edges, 2), np.r_[0.0, np.repeat(mark.counts, 2), 0.0]
            return "", path(frame.outline(x, y, closed=True), fill(colour, OPACITIES[marks.Histogram]))
        case marks.HLine():
            return "", path(frame.outline([frame.x.low, frame.x.high], [mark.y] * 2), stroke(colour, style=mark.style))
        case marks.VLine():
            return "", path(frame.outline([mark.x] * 2, [frame.y.low, frame.y.high]), stroke(colour, style=mark.style))
        case marks.HBand():
            ends = [frame.x.low, frame.x.high]
            edges = "".join(frame.outline(ends, [level] * 2) for level in (mark.lower, mark.upper))
            area = path(frame.box(-np.inf, np.inf, mark.lower, mark.upper), fill(colour, OPACITIES[marks.HBand]))
            return area, path(edges, stroke(colour, THIN_WIDTH))  # in front of marks, which would hide a narrow band
        case marks.VSpan():
            return path(frame.box(mark.start, mark.end, -np.inf, np.inf), fill(colour, OPACITIES[marks.VSpan])), ""
        case marks.Reference():
            x = np.array([frame.x.low, frame.x.high])
            return "", path(frame.outline(x, mark.intercept + mark.slope * x), stroke(colour, style=mark.style))
        case marks.Tiles():
            return "", draw_tiles(mark, frame)
    raise TypeError(f"{type(mark).__name__} cannot be drawn")


def draw_points(mark: marks.Points, frame: Frame) -> str:
    """Symbols with error bars and names."""
    colour, x, y, svg = COLOURS[mark.colour], frame.place_x(mark.x), frame.place_y(mark.y), ""
    if mark.y_std is not None:
        svg = error_bars(x, frame.place_y(mark.y - mark.y_std), frame.place_y(mark.y + mark.y_std), colour)
    svg += path(symbols(x, y), dots(colour))
    # Beyond it a name stands to the left; above a point it would squeeze the curve.
    far = frame.left + 0.88 * frame.width
    for a, b, name in zip(x.tolist(), y.tolist(), mark.names, strict=False):
        shift, anchor = (-BESIDE, "end") if a > far else (BESIDE, "start")
        svg += words(a + shift, b + 0.35 * SMALL_SIZE, name, colour, SMALL_SIZE, anchor, halo=COLOURS["paper"])
    return svg


def error_bars(x: Array, low: Array, high: Array, colour: str) -> str:
    """Vertical bars with ends."""
    gap = np.full_like(x, np.nan)
    columns = [(x, low), (x, high), (gap, gap)]
    columns += [place for y in (low, high) for place in ((x - BAR_END, y), (x + BAR_END, y), (gap, gap))]
    xs, ys = (np.stack(side, axis=1).ravel() for side in zip(*columns, strict=True))
    return path(trace(xs, ys), stroke(colour))


def draw_stems(mark: marks.Stems, frame: Frame) -> str:
    """Stems from zero, with heads unless there are many."""
    colour, many = COLOURS[mark.colour], len(mark.x) > MANY
    x, zero = frame.place_x(mark.x), frame.place_y(np.zeros(len(mark.x)))
    y, gap = frame.place_y(mark.y), np.full(len(mark.x), np.nan)
    xs, ys = np.stack([x, x, gap], axis=1).ravel(), np.stack([zero, y, gap], axis=1).ravel()
    heads = "" if many else path(symbols(x, y), dots(colour, 2.2))
    base = path(frame.outline([frame.x.low, frame.x.high], [0.0, 0.0]), stroke(AXES, 0.6))
    return base + path(trace(xs, ys), stroke(colour, THIN_WIDTH if many else LINE_WIDTH)) + heads


def draw_bars(bars: Sequence[marks.Bars], frame: Frame) -> str:
    """The Bars of a panel side by side over their shared names."""
    svg, width = "", BARS_WIDTH / max(len(bars), 1)
    for i, mark in enumerate(bars):
        middle = np.arange(len(mark.names), dtype=np.float64) + (i - (len(bars) - 1) / 2) * width
        half, tops = BAR_SHARE * width / 2, zip(middle.tolist(), mark.heights.tolist(), strict=True)
        boxes = (frame.box(x - half, x + half, 0.0, y) for x, y in tops)
        svg += path("".join(boxes), fill(COLOURS[mark.colour], 1.0))
    return svg


def draw_tiles(mark: marks.Tiles, frame: Frame) -> str:
    """Tinted tiles with their numbers."""
    svg = ""
    for k, value in enumerate(mark.value.tolist()):
        row, column = divmod(k, len(mark.names))
        colour, half = COLOURS[mark.colour if value >= 0 else mark.opposite], TILE / 2
        box = frame.box(column - half, column + half, row - half, row + half)
        x, y = float(frame.place_x([column])[0]), float(frame.place_y([row])[0])
        number = in_format(value, ".2f")
        svg += path(box, fill(colour, 0.6 * min(abs(value), 1.0))) + words(x, y + 3, number, WORDS, anchor="middle")
    return svg


def draw_sample(mark: marks.AnyMark | marks.Line3D | marks.Points3D, x: float, y: float, width: float) -> str:
    """The sample of a mark before its legend entry, in the middle of a line [pt]."""
    colour, ends = COLOURS[mark.colour], np.array([x, x + width])
    if isinstance(mark, marks.Points | marks.Points3D):
        return path(symbols(np.array([x + width / 2]), np.array([y])), dots(colour))
    if isinstance(mark, marks.Band | marks.HBand | marks.VSpan | marks.Histogram | marks.Bars):
        box = trace(ends[[0, 1, 1, 0]], y + np.array([-3.0, -3.0, 3.0, 3.0]), closed=True)
        return path(box, fill(colour, OPACITIES.get(type(mark), 1.0)))
    return path(trace(ends, np.array([y, y])), stroke(colour, style=getattr(mark, "style", "solid")))
