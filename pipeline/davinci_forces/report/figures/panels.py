"""Draw one panel with matplotlib: its marks, its axes, and its title and legend above the axes."""

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from davinci_forces.report.content.marks import AnyMark, Bars, Line, Panel, Points, Stems, Tiles
from davinci_forces.report.content.thinning import is_sorted, thin_mark
from davinci_forces.report.figures.draw import draw_bars, draw_mark, unescape_label
from davinci_forces.report.figures.palette import assign_looks
from davinci_forces.report.figures.ticks import scale_ticks, set_log_ticks

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

VERTICES, LOOP_VERTICES, SYMBOLS_PER_MM = (
    8,
    30,
    3,
)  # of one mark in a millimetre: finer than its lines and symbols are wide
LETTER_WIDTH = 1.65  # [mm] width of a character of a label
LINE_HEIGHT = 3.9  # [mm] height of a line of a label or a row of a legend
SAMPLE = 10.0  # [mm] width of the sample before a legend entry, with the gaps around it

NAME = 3.6  # [mm] height of a point's name above or below the point
ABOUT = 18.0  # [mm] of a panel's height for the words above and below the axes


@dataclass(frozen=True)
class Heading:
    """What stands above a panel: its title in lines, and the labels and entries of its legend, so many side by side.

    A legend of one row stands `beside` the title if both fit.
    """

    title: str
    labels: tuple[str, ...]
    entries: tuple[str, ...]
    columns: int
    beside: bool

    @property
    def height(self) -> float:
        """Height of the whole heading [mm]."""
        # Entries that stand side by side have one line each.
        rows = -(-len(self.entries) // self.columns) if self.columns > 1 else sum(map(_lines, self.entries))
        lines = rows * (not self.beside) + (_lines(self.title) if self.title else 0)
        return LINE_HEIGHT * lines + 1.5


def plan_heading(panel: Panel, room: float) -> Heading:
    """The heading of a panel whose axes are this wide [mm]."""
    labels = tuple(mark.label for mark in panel.marks if mark.label)
    longest = max(map(len, labels), default=0)
    columns = max(1, min(len(labels), int(room / (SAMPLE + LETTER_WIDTH * longest))))
    entries = tuple(_wrap(label, room - SAMPLE) for label in labels)
    title = _wrap(panel.title, 0.9 * room)  # bold letters are wider
    row = sum(SAMPLE + LETTER_WIDTH * len(label) for label in labels) + 3
    beside = bool(title and labels) and columns == len(labels) and 1.2 * LETTER_WIDTH * len(title) + row <= room
    return Heading(title, labels, entries, columns, beside)


def _lines(text: str) -> int:
    return text.count("\n") + 1


def draw_panel(axes: "Axes", panel: Panel, width: float, height: float, x_label: bool) -> None:
    """Draw a panel into a cell of this width and height [mm], without what stands above it."""
    _draw_marks(axes, panel, width)
    if panel.x_range:
        axes.set_xlim(*panel.x_range)
    if panel.y_range:
        axes.set_ylim(*panel.y_range)
    tiles = any(isinstance(mark, Tiles) for mark in panel.marks)
    named = tiles or any(isinstance(mark, Bars) for mark in panel.marks)
    across = panel.x_label if named else _ticks(axes, "x", panel.x_log, panel.x_label, 4 if width < 70 else 8)
    up = panel.y_label if tiles else _ticks(axes, "y", panel.y_log, panel.y_label, 5)
    axes.set_xlabel(wrap_label(across, width - 18) if x_label else "", parse_math=False)
    axes.set_ylabel(wrap_label(up, height - ABOUT), parse_math=False)


def _draw_marks(axes: "Axes", panel: Panel, width: float) -> None:
    marks = list(assign_looks(panel.marks))
    draw_bars([mark for mark in marks if isinstance(mark, Bars)], axes)
    for order, mark in enumerate(marks):
        if not isinstance(mark, Bars):
            draw_mark(thin_mark(mark, max_points(mark, width)), axes, 2 + 0.01 * order)
    if any(isinstance(mark, Points | Stems) for mark in panel.marks):
        axes.margins(x=0.03)  # room for symbols at the ends


def make_room_for_names(axes: "Axes", panel: Panel, height: float) -> None:
    """Widen the range of y so that the names of points fit into axes of a height [mm]."""
    if panel.y_range is None and any(isinstance(mark, Points) and mark.names for mark in panel.marks):
        low, high = axes.get_ylim()
        room = NAME / max(height - 2 * NAME, NAME) * (high - low)
        axes.set_ylim(low - room, high + room)


def max_points(mark: AnyMark, width: float) -> int:
    """The number of points beyond which further points are not visible in a panel of this width [mm]."""
    if isinstance(mark, Points | Stems):
        return round(SYMBOLS_PER_MM * width)
    return round((VERTICES if not isinstance(mark, Line) or is_sorted(mark.x) else LOOP_VERTICES) * width)


def _ticks(axes: "Axes", name: str, log: bool, label: str, max_ticks: int) -> str:
    """Put readable ticks on one axis; return its label, with the power of ten that its numbers omit."""
    axis = axes.xaxis if name == "x" else axes.yaxis
    if log:
        axes.set_xscale("log") if name == "x" else axes.set_yscale("log")
        set_log_ticks(axis)
        return label
    axes.locator_params(nbins=max_ticks, axis="x" if name == "x" else "y")
    return scale_ticks(axis, label)


def wrap_label(label: str, room: float) -> str:
    """An axis label in lines that fit into `room` [mm], the unit on a line of its own where that is enough."""
    meaning, bracket, unit = label.rpartition(" [")
    if not meaning or len(label) * LETTER_WIDTH <= room:
        return _wrap(label, room)
    return f"{_wrap(meaning, room)}\n{bracket.strip()}{unit}"


def _wrap(text: str, room: float) -> str:
    return textwrap.fill(text, max(int(room / LETTER_WIDTH), 1), break_long_words=False, break_on_hyphens=False)


def draw_heading(axes: "Axes", heading: Heading, room: float, height: float) -> None:
    """Title at the top of `room` [mm] above axes of a height [mm], and the legend right above them or beside it."""
    if heading.title:
        axes.text(
            0, 1 + (room - 0.5) / height, heading.title, transform=axes.transAxes, va="top", fontsize=9,
            fontweight="bold", parse_math=False,
        )  # fmt: skip
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        # In the order of the marks, which is not that of matplotlib's kinds of artists.
        ranks = [heading.labels.index(unescape_label(label)) for label in labels]
        handles = [handle for _, handle in sorted(zip(ranks, handles, strict=True), key=lambda pair: pair[0])]
        anchor = (1.0, 1 + (room - LINE_HEIGHT - 1.0) / height) if heading.beside else (0.0, 1.0)
        draw_legend(axes, handles, heading, anchor)


def draw_legend(axes: "Axes", handles: list["Artist"], heading: Heading, anchor: tuple[float, float]) -> None:
    """The legend above the axes, where it covers no data; its corner, left or right, at the anchor."""
    place: Any = "lower right" if heading.beside else "lower left"
    legend = axes.legend(
        handles, [" "] * len(handles), loc=place, bbox_to_anchor=anchor, ncols=heading.columns, frameon=False,
        borderpad=0, borderaxespad=0.25, handlelength=2.6, columnspacing=1.4, labelspacing=0.3, handletextpad=0.5,
    )  # fmt: skip
    # Set afterwards: matplotlib leaves out a label that begins with an underscore, and reads dollars as maths.
    for text, entry in zip(legend.get_texts(), heading.entries, strict=True):
        text.set(text=entry, parse_math=False)
