"""Drawing one panel with matplotlib: its marks, its axes, and its title and legend above them."""

import textwrap
from typing import TYPE_CHECKING

from pipeline.report.content.marks import AnyMark, Bars, Line, Panel, Points, Stems
from pipeline.report.figures.draw import draw_bars, draw_mark, unescape_label
from pipeline.report.figures.palette import assign_colours
from pipeline.report.figures.ticks import scale_ticks, set_log_ticks
from pipeline.report.figures.traces import is_sorted, thin_mark

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VERTICES, LOOP_VERTICES, SYMBOLS = 8, 30, 3  # of one mark in a millimetre: finer than its lines and symbols are wide
LETTER = 1.65  # [mm] that a letter of a label takes
LEGEND_ROW = 3.9  # [mm]


def draw_panel(axes: "Axes", panel: Panel, width: float, height: float, x_label: bool) -> None:
    """Draw a panel into a cell of this width and height [mm], the legend's rows after the first not counted."""
    _draw_marks(axes, panel, width)
    if panel.x_range:
        axes.set_xlim(*panel.x_range)
    if panel.y_range:
        axes.set_ylim(*panel.y_range)
    bars = any(isinstance(mark, Bars) for mark in panel.marks)
    across = panel.x_label if bars else _ticks(axes, "x", panel.x_log, panel.x_label, 4 if width < 70 else 8)
    up = _ticks(axes, "y", panel.y_log, panel.y_label, 5)
    axes.set_xlabel(wrap_label(across, width - 18) if x_label else "", parse_math=False)
    axes.set_ylabel(wrap_label(up, height - 18), parse_math=False)
    draw_heading(axes, panel.title, width)


def _draw_marks(axes: "Axes", panel: Panel, width: float) -> None:
    marks = list(assign_colours(panel.marks))
    draw_bars([(mark, colour) for mark, colour in marks if isinstance(mark, Bars)], axes)
    for order, (mark, colour) in enumerate(marks):
        if not isinstance(mark, Bars):
            draw_mark(thin_mark(mark, _max_points(mark, width)), axes, colour, 2 + 0.01 * order)
    if any(isinstance(mark, Points | Stems) for mark in panel.marks):
        axes.margins(x=0.03)  # room for symbols at the ends


def _max_points(mark: AnyMark, width: float) -> int:
    """Points beyond which more of them cannot be seen in a panel of this width [mm]."""
    if isinstance(mark, Points | Stems):
        return round(SYMBOLS * width)
    return round((VERTICES if not isinstance(mark, Line) or is_sorted(mark.x) else LOOP_VERTICES) * width)


def _ticks(axes: "Axes", name: str, log: bool, label: str, max_ticks: int) -> str:
    """Put readable ticks on one axis; returns its label, with the power of ten that its numbers leave out."""
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
    if not meaning or len(label) * LETTER <= room:
        return _wrap(label, room)
    return f"{_wrap(meaning, room)}\n{bracket.strip()}{unit}"


def _wrap(text: str, room: float) -> str:
    return textwrap.fill(text, max(int(room / LETTER), 1), break_long_words=False, break_on_hyphens=False)


def legend_columns(labels: list[str], width: float) -> int:
    """Entries side by side that fit above a panel of this width [mm]."""
    return max(1, min(len(labels), int((width - 20) / (10 + LETTER * max(map(len, labels))))))


def legend_rows(panel: Panel, width: float) -> int:
    """Rows of the legend above a panel of this width [mm]."""
    labels = [mark.label for mark in panel.marks if mark.label]
    columns = legend_columns(labels, width) if labels else 1
    if columns > 1:
        return -(-len(labels) // columns)
    return sum(_wrap_entry(label, width).count("\n") + 1 for label in labels)


def _wrap_entry(label: str, width: float) -> str:
    return _wrap(label, width - 32)


def draw_heading(axes: "Axes", title: str, width: float) -> None:
    """Title and legend above the axes, where they cover no data."""
    handles, labels = axes.get_legend_handles_labels()
    title = _wrap(title, 0.9 * (width - 18))  # bold letters are wider
    if not handles:
        axes.set_title(title, loc="left", fontsize=9, fontweight="bold", pad=4, parse_math=False)
        return
    legend = axes.legend(
        handles, [" "] * len(labels), loc="lower left", bbox_to_anchor=(0, 1.0), ncols=legend_columns(labels, width),
        title=title, frameon=False, alignment="left", borderpad=0, borderaxespad=0.25, handlelength=1.6,
        columnspacing=1.4, labelspacing=0.3, handletextpad=0.5, title_fontproperties={"weight": "bold", "size": 9},
    )  # fmt: skip
    legend.get_title().set_parse_math(False)
    # Set afterwards: matplotlib leaves out a label that begins with an underscore, and reads dollars as maths.
    for text, label in zip(legend.get_texts(), labels, strict=True):
        text.set(text=_wrap_entry(unescape_label(label), width), parse_math=False)
