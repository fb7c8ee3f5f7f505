"""Time traces that zoom and pan, drawn in the browser by Bokeh, whose script travels in the page."""

import re
from functools import cache, singledispatch
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.report.content import Figure
from pipeline.report.content.marks import Band, HBand, Histogram, HLine, Line, Panel, Points, Stems, VLine, VSpan
from pipeline.report.figures.palette import assign_colours

Json = dict[str, Any]
PIXELS = 96 / 25.4  # of CSS in a millimetre
HEAD = 34  # [px] that the legend takes
TOOLS = "xpan,xbox_zoom,box_zoom,xwheel_zoom,reset,save"
DASHES = {"solid": "solid", "dashed": [6, 3], "dotted": [2, 3]}


@cache
def bokeh_script() -> str:
    """Bokeh's own script, the minified core only: no tables, widgets, WebGL or maths."""
    import bokeh

    return (Path(bokeh.__file__).parent / "server/static/js/bokeh.min.js").read_text(encoding="utf-8")


def embed_items(figures: dict[str, Figure]) -> Json:
    """What Bokeh's `embed_items` needs to draw each figure into the element of its name."""
    from bokeh.document import Document

    documents, items = {}, []
    for name, figure in figures.items():
        document = Document()
        document.add_root(_layout(figure))
        content = _renumber_ids(document.to_json(deferred=False), name)
        root = content["roots"][0]["id"]
        documents[name] = content
        items.append({"docid": name, "roots": {root: name}, "root_ids": [root]})
    return {"documents": documents, "items": items}


def _renumber_ids(content: Any, prefix: str) -> Any:
    """The same document with its ids counted anew: Bokeh counts on through the life of a process."""
    fresh: dict[str, str] = {}
    numbers = count(1)

    def rename(part: Any) -> Any:
        if isinstance(part, list):
            return [rename(item) for item in part]
        if not isinstance(part, dict):
            return part
        if re.fullmatch(r"p\d+", str(part.get("id"))) and part["id"] not in fresh:
            fresh[part["id"]] = f"{prefix}-{next(numbers)}"
        return {key: fresh[value] if key == "id" and value in fresh else rename(value) for key, value in part.items()}

    return rename(content)


def _layout(figure: Figure) -> Any:
    from bokeh.layouts import gridplot

    plots: list[Any] = []
    for panel in figure.panels:
        plots.append(_plot(panel, figure, plots[0].x_range if plots else None))
    for plot, panel in zip(plots[-figure.columns :], figure.panels[-figure.columns :], strict=True):
        plot.xaxis.axis_label = _plain_text(panel.x_label)
        plot.height += 22
    return gridplot(
        plots, ncols=figure.columns, sizing_mode="stretch_width", merge_tools=True, toolbar_location="right",
        toolbar_options={"logo": None},
    )  # fmt: skip


def _plot(panel: Panel, figure: Figure, x_range: Any) -> Any:
    from bokeh.models import Title
    from bokeh.plotting import figure as new_plot

    plot = new_plot(
        height=round(figure.height * PIXELS) + HEAD, min_width=240, tools=TOOLS, active_drag="xbox_zoom",
        x_range=x_range or _range(panel.x_range, 0.01), y_range=_range(panel.y_range, 0.06), output_backend="canvas",
        x_axis_type="log" if panel.x_log else "linear", y_axis_type="log" if panel.y_log else "linear",
        background_fill_color="#ffffff", border_fill_color="#ffffff", outline_line_color=None, lod_threshold=None,
        min_border_right=12,
    )  # fmt: skip
    _style(plot, panel)
    entries = [
        (_plain_text(mark.label), [draw_trace(mark, plot, colour)]) for mark, colour in assign_colours(panel.marks)
    ]
    _add_legend(plot, [(label, renderers) for label, renderers in entries if label])
    if panel.title:
        plot.add_layout(Title(text=_plain_text(panel.title), text_font_size="13px", text_color="#1a1a1a"), "above")
    return plot


def _range(limits: tuple[float, float] | None, padding: float) -> Any:
    from bokeh.models import DataRange1d, Range1d

    return Range1d(*limits) if limits else DataRange1d(range_padding=padding)


def _style(plot: Any, panel: Panel) -> None:
    plot.yaxis.axis_label = _plain_text(panel.y_label)
    for axis in (plot.xaxis, plot.yaxis):
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "12px"
        axis.axis_line_color = axis.major_tick_line_color = "#777777"
        axis.minor_tick_line_color = None
    plot.yaxis.ticker.desired_num_ticks = 5
    plot.grid.grid_line_color = "#e4e4e4"
    # Room of one width to the left of every panel keeps the axes of a column in line.
    plot.min_border_left = 74


def _add_legend(plot: Any, items: list[tuple[str, list[Any]]]) -> None:
    from bokeh.core.properties import value
    from bokeh.models import Legend, LegendItem

    if items:
        legend = Legend(
            items=[LegendItem(label=value(label), renderers=renderers) for label, renderers in items],
            orientation="horizontal", location="left", click_policy="hide", border_line_color=None, padding=0, margin=2,
            label_text_font_size="12px", background_fill_alpha=0.0, spacing=14, glyph_width=18,
        )  # fmt: skip
        plot.add_layout(legend, "above")


def _plain_text(text: str) -> str:
    """A text that Bokeh takes for text: between its signs for maths it would look for a script on the network."""
    return re.sub(r"\$(?=\$)|\\(?=[\[(])", "\\g<0>\u200b", text)


def _single_precision(column: Array) -> Any:
    """Single precision, where it tells neighbouring samples apart."""
    steps = np.abs(np.diff(column))
    step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0
    return column if float(np.nanmax(np.abs(column), initial=0.0)) > 2**20 * step else column.astype(np.float32)


@singledispatch
def draw_trace(mark: Any, plot: Any, colour: str) -> Any:
    """Draw one mark on a plot; returns what its legend entry hides."""
    raise TypeError(f"{type(mark).__name__} cannot be part of a zoomable figure")


@draw_trace.register(Line)
def _(mark: Line, plot: Any, colour: str) -> Any:
    dash = DASHES[mark.style]
    return plot.line(
        _single_precision(mark.x), mark.y.astype(np.float32), line_color=colour, line_width=1.2, line_dash=dash
    )


@draw_trace.register(Points)
def _(mark: Points, plot: Any, colour: str) -> Any:
    if mark.y_std is not None:
        plot.segment(mark.x, mark.y - mark.y_std, mark.x, mark.y + mark.y_std, line_color=colour)
    if mark.names:
        plot.text(mark.x, mark.y, list(map(_plain_text, mark.names)), text_font_size="11px", text_align="center")
    return plot.scatter(_single_precision(mark.x), mark.y.astype(np.float32), size=4, color=colour, line_color=None)


@draw_trace.register(Band)
def _(mark: Band, plot: Any, colour: str) -> Any:
    lower, upper = mark.lower.astype(np.float32), mark.upper.astype(np.float32)
    return plot.varea(_single_precision(mark.x), lower, upper, fill_color=colour, fill_alpha=0.25)


@draw_trace.register(Stems)
def _(mark: Stems, plot: Any, colour: str) -> Any:
    return plot.segment(mark.x, np.zeros_like(mark.y), mark.x, mark.y, line_color=colour, line_width=1.2)


@draw_trace.register(Histogram)
def _(mark: Histogram, plot: Any, colour: str) -> Any:
    left, right = mark.edges[:-1], mark.edges[1:]
    return plot.quad(left=left, right=right, bottom=0, top=mark.counts, color=colour, fill_alpha=0.75)


@draw_trace.register(HLine)
def _(mark: HLine, plot: Any, colour: str) -> Any:
    return plot.hspan(y=[mark.y], line_color=colour, line_dash=DASHES[mark.style])


@draw_trace.register(VLine)
def _(mark: VLine, plot: Any, colour: str) -> Any:
    return plot.vspan(x=[mark.x], line_color=colour, line_dash=DASHES[mark.style])


@draw_trace.register(HBand)
def _(mark: HBand, plot: Any, colour: str) -> Any:
    return plot.hstrip(y0=[mark.lower], y1=[mark.upper], color=colour, fill_alpha=0.18, line_color=None)


@draw_trace.register(VSpan)
def _(mark: VSpan, plot: Any, colour: str) -> Any:
    return plot.vstrip(x0=[mark.start], x1=[mark.end], color=colour, fill_alpha=0.18, line_color=None)
