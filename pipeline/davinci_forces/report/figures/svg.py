"""Draw figures as SVG with matplotlib: the same bytes for the same figure, no date, and words as text."""

import io
import re
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from davinci_forces.report.content import Figure, Figure3D
from davinci_forces.report.content.marks import Panel
from davinci_forces.report.figures.draw import draw_mark_3d
from davinci_forces.report.figures.grid import INCH, PAGE_WIDTH, arrange
from davinci_forces.report.figures.palette import SURROUNDINGS, assign_looks
from davinci_forces.report.figures.panels import draw_heading, draw_panel, plan_heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

WORDS, AXES, GRID = (SURROUNDINGS[part][0] for part in ("words", "axes", "grid"))
STYLE: Any = {
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.edgecolor": AXES,
    "axes.grid": True,
    "axes.labelcolor": WORDS,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.unicode_minus": True,
    "axes.xmargin": 0.01,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",  # words stay text, which each writer sets in its own font
    "svg.hashsalt": "davinci-forces",
    "text.color": WORDS,
    "xtick.color": AXES,
    "xtick.labelcolor": WORDS,
    "xtick.labelsize": 8,
    "ytick.color": AXES,
    "ytick.labelcolor": WORDS,
    "ytick.labelsize": 8,
}
LONG = 400  # characters; a longer path is written in relative steps
drawn: "WeakKeyDictionary[Figure | Figure3D, str]" = WeakKeyDictionary()


def svg(figure: Figure | Figure3D) -> str:
    """The figure as an SVG element; a figure that several reports show is drawn once."""
    if figure not in drawn:
        drawn[figure] = draw_svg(figure)
    return drawn[figure]


def draw_svg(figure: Figure | Figure3D) -> str:
    """Draw the figure as an SVG element, without the cache of `svg`."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        file = io.StringIO()
        metadata = {"Date": None, "Creator": None, "Format": None, "Type": None}
        draw_figure(figure).savefig(file, format="svg", metadata=metadata)
    text = file.getvalue()
    return _round_coordinates(text[text.index("<svg") :])


def _round_coordinates(text: str) -> str:
    """Round coordinates to a hundredth of a point, in long paths to a tenth: invisible, and a fifth of the size."""
    text = re.sub(r'(?<= [xy]=")-?\d+\.\d{3,}', lambda n: f"{float(n[0]):.2f}", text)
    return re.sub(r' d="[^"]*"', lambda path: _round_path(path[0]), text)


def _round_path(path: str) -> str:
    if len(path) > LONG and not re.search(r"[A-KN-Za-z]", path[4:-1]):
        return f' d="{_steps(path)}"'
    path = re.sub(r"-?\d+\.\d{2,}", lambda n: f"{float(n[0]):.2f}", path)
    return re.sub(r"\s*([A-Za-z])\s+", r"\1", path)


def _steps(path: str) -> str:
    """A path of straight lines as steps in tenths of a point: half the characters of absolute coordinates."""
    parts: list[str] = []
    here = (0, 0)
    for letter, x, y in re.findall(r"([ML])\s*(-?[\d.]+) (-?[\d.]+)", path):
        there = (round(10 * float(x)), round(10 * float(y)))
        if letter == "M":
            parts.append(f"M{there[0] / 10:g} {there[1] / 10:g}l")
        elif there != here:
            parts.append(f"{_tenths(there[0] - here[0])}{_tenths(there[1] - here[1])}")
        here = there
    return re.sub(r"l(?=M|$)|(?<=l) ", "", "".join(parts))


def _tenths(number: int) -> str:
    """A number of tenths as text after another number: ` 1.2`, ` .3`, `-4`."""
    text = f"{number / 10:g}".replace("0.", ".", 1) if abs(number) < 10 else f"{number / 10:g}"
    return text if text.startswith("-") else f" {text}"


def draw_figure(figure: Figure | Figure3D) -> "Canvas":
    """A figure on a canvas of the page's width."""
    if isinstance(figure, Figure3D):
        return _draw_space(figure)
    canvas = _canvas(figure.height)
    width = PAGE_WIDTH / figure.columns
    shared: Axes | None = None
    for place, panel in enumerate(figure.panels):
        axes = canvas.add_axes((0, 0, 1, 1), sharex=shared, label=str(place))
        shared = axes if figure.zoomable else None
        last = place + figure.columns >= len(figure.panels)
        draw_panel(axes, panel, width, figure.height, x_label=last or not figure.zoomable)
    arrange(canvas, figure)
    return canvas


def _canvas(height: float) -> "Canvas":
    """An empty canvas of the page's width, made without pyplot and its global state."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    canvas = Canvas(figsize=(PAGE_WIDTH / INCH, height / INCH), dpi=72)
    FigureCanvasSVG(canvas)  # words are laid out by their sizes in SVG, not in pixels
    return canvas


def _draw_space(figure: Figure3D) -> "Canvas":
    canvas = _canvas(figure.height)
    legend = plan_heading(Panel("", "", "", figure.marks), PAGE_WIDTH)  # type: ignore[arg-type]
    height = figure.height - legend.height
    axes: Any = canvas.add_axes((0, 0, 1, height / figure.height), projection="3d")
    for mark in assign_looks(figure.marks):
        draw_mark_3d(mark, axes)
    _set_equal_ranges(axes, figure)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))  # the page's own colour, dark or light
    axes.set_xlabel(figure.x_label)
    axes.set_ylabel(figure.y_label)
    axes.set_zlabel(figure.z_label)
    axes.view_init(elev=figure.elevation, azim=figure.azimuth)
    draw_heading(axes, legend, legend.height, height)
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
