"""Figures as SVG, drawn by matplotlib: the same bytes for the same figure, text as outlines, no date."""

import io
import re
import warnings
from functools import singledispatch
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from pipeline.report.content import Figure, Figure3D
from pipeline.report.figures.draw import draw_mark_3d
from pipeline.report.figures.palette import assign_colours
from pipeline.report.figures.panels import LEGEND_ROW, draw_heading, draw_panel, legend_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

WIDTH = 170.0  # [mm] of the text on an A4 page
INCH = 25.4  # [mm]
STYLE: Any = {
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.labelcolor": "#222222",
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.unicode_minus": True,
    "axes.xmargin": 0.01,
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "legend.fontsize": 8.5,
    "svg.fonttype": "path",
    "svg.hashsalt": "davinci-forces",
    "xtick.color": "#555555",
    "xtick.labelcolor": "#222222",
    "xtick.labelsize": 8,
    "ytick.color": "#555555",
    "ytick.labelcolor": "#222222",
    "ytick.labelsize": 8,
}
drawn: "WeakKeyDictionary[Figure | Figure3D, str]" = WeakKeyDictionary()


def svg(figure: Figure | Figure3D) -> str:
    """The figure as an SVG element; drawn once, however many reports show it."""
    if figure not in drawn:
        import matplotlib as mpl

        with mpl.rc_context(STYLE), warnings.catch_warnings():
            # A character that the font lacks is drawn as a box; the name is in the tables as well.
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            drawn[figure] = _to_svg(draw_figure(figure))
    return drawn[figure]


def _to_svg(canvas: "Canvas") -> str:
    file = io.StringIO()
    canvas.savefig(file, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = file.getvalue()
    return _round_coordinates(text[text.index("<svg") :])


def _round_coordinates(text: str) -> str:
    """Coordinates to a hundredth of a point, in long paths to a tenth: a third of the size, and it cannot be seen."""
    text = re.sub(r'(?<= [xy]=")-?\d+\.\d{3,}', lambda n: f"{float(n[0]):.2f}", text)
    return re.sub(r' d="[^"]*"', lambda path: _round_path(path[0]), text)


def _round_path(path: str) -> str:
    decimals = 1 if len(path) > 2000 else 2
    path = re.sub(r"-?\d+\.\d{2,}", lambda n: f"{float(n[0]):.{decimals}f}", path)
    return re.sub(r"\s*([A-Za-z])\s+", r"\1", path)


@singledispatch
def draw_figure(figure: Any) -> "Canvas":
    """A figure on a canvas of the page's width."""
    raise TypeError(f"{type(figure).__name__} is not a figure")


@draw_figure.register(Figure)
def _(figure: Figure) -> "Canvas":
    rows = -(-len(figure.panels) // figure.columns)
    width = WIDTH / figure.columns
    extra = LEGEND_ROW * max(0, max(legend_rows(panel, width) for panel in figure.panels) - 1)
    canvas = _canvas(rows * (figure.height + extra))
    shared: Axes | None = None
    for place, panel in enumerate(figure.panels):
        axes = canvas.add_subplot(rows, figure.columns, place + 1, sharex=shared)
        shared = axes if figure.zoomable else None
        last = place + figure.columns >= len(figure.panels)
        draw_panel(axes, panel, width, figure.height, x_label=last or not figure.zoomable)
    canvas.align_ylabels()
    return canvas


def _canvas(height: float) -> "Canvas":
    """An empty canvas of the page's width, made without pyplot and its global state."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.04, hspace=0.03, wspace=0.03)
    canvas = Canvas(figsize=(WIDTH / INCH, height / INCH), dpi=72, layout=layout)
    FigureCanvasSVG(canvas)  # words are laid out by the sizes they have in SVG, not in pixels
    return canvas


@draw_figure.register(Figure3D)
def _(figure: Figure3D) -> "Canvas":
    canvas = _canvas(figure.height)
    axes: Any = canvas.add_subplot(projection="3d")
    for mark, colour in assign_colours(figure.marks):
        draw_mark_3d(mark, axes, colour)
    _set_equal_ranges(axes, figure)
    axes.set_xlabel(figure.x_label)
    axes.set_ylabel(figure.y_label)
    axes.set_zlabel(figure.z_label)
    axes.view_init(elev=figure.elevation, azim=figure.azimuth)
    draw_heading(axes, "", WIDTH)
    return canvas


def _set_equal_ranges(axes: Any, figure: Figure3D) -> None:
    """Ranges of one length about the middle of the marks, so that angles in space are true."""
    points = np.hstack([[mark.x, mark.y, mark.z] for mark in figure.marks])
    least, greatest = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    half = 0.55 * max(float(np.max(greatest - least)), 1e-9)
    for axis, middle in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), (least + greatest) / 2, strict=True):
        axis(middle - half, middle + half)
    axes.set_box_aspect((1, 1, 1), zoom=0.9)
    axes.locator_params(nbins=5)
