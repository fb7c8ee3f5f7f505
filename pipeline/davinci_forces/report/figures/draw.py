"""Draw each mark with matplotlib: one function per mark, all with the same arguments."""

from collections.abc import Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from davinci_forces.report.content.marks import (
    Band,
    Bars,
    HBand,
    Histogram,
    HLine,
    Line,
    Line3D,
    Points,
    Points3D,
    Reference,
    Stems,
    Tiles,
    VLine,
    VSpan,
)
from davinci_forces.report.content.number import MINUS
from davinci_forces.report.figures.palette import COLOURS, SURROUNDINGS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D

DASHES: dict[str, Any] = {
    "solid": "-",
    "dashed": (0, (4, 1.6)),
    "dotted": (0, (1, 1.4)),
    "dashdot": (0, (5, 1.4, 1, 1.4)),
}
BAR_WIDTH = 0.9  # [pt] width of a line or an error bar
MANY = 60  # more stems than this are thin and have no heads, so that marks behind them stay visible


def escape_label(text: str) -> str:
    """A label that matplotlib keeps even when it begins with an underscore; `unescape_label` undoes it."""
    return f" {text}" if text else ""


def unescape_label(text: str) -> str:
    """The text that was passed to `escape_label`."""
    return text.removeprefix(" ")


@singledispatch
def draw_mark(mark: Any, axes: "Axes", order: float) -> None:
    """Draw one mark on matplotlib axes, with the colour and style that it states."""
    raise TypeError(f"{type(mark).__name__} cannot be drawn")


def _stroke(mark: Any, order: float) -> dict[str, Any]:
    """The looks of a mark that is a line."""
    style, label = DASHES[mark.style], escape_label(mark.label)
    return {"color": COLOURS[mark.colour], "linewidth": BAR_WIDTH, "linestyle": style, "label": label, "zorder": order}


def _fill(mark: Any, alpha: float, order: float) -> dict[str, Any]:
    """The looks of a mark that is an area."""
    label = escape_label(mark.label)
    return {"color": COLOURS[mark.colour], "alpha": alpha, "linewidth": 0, "label": label, "zorder": order}


@draw_mark.register(Line)
def _(mark: Line, axes: "Axes", order: float) -> None:
    axes.plot(mark.x, mark.y, **_stroke(mark, order))


@draw_mark.register(Points)
def _(mark: Points, axes: "Axes", order: float) -> None:
    colour = COLOURS[mark.colour]
    axes.errorbar(
        mark.x, mark.y, mark.y_std, fmt="o", markersize=2.6, markeredgewidth=0, color=colour, elinewidth=BAR_WIDTH,
        capsize=2, label=escape_label(mark.label), zorder=order,
    )  # fmt: skip
    for x, y, name in zip(mark.x, mark.y, mark.names, strict=False):
        axes.annotate(
            name, (x, y), (0, 4 if y >= 0 else -4), textcoords="offset points", ha="center",
            va="bottom" if y >= 0 else "top", fontsize=8, color=colour, parse_math=False, zorder=order + 1,
        )  # fmt: skip


@draw_mark.register(Band)
def _(mark: Band, axes: "Axes", order: float) -> None:
    axes.fill_between(mark.x, mark.lower, mark.upper, **_fill(mark, 0.25, 1.5))


@draw_mark.register(Stems)
def _(mark: Stems, axes: "Axes", order: float) -> None:
    colour, many = COLOURS[mark.colour], len(mark.x) > MANY
    axes.vlines(
        mark.x, 0.0, mark.y, color=colour, linewidth=0.5 if many else BAR_WIDTH, label=escape_label(mark.label),
        zorder=order,
    )  # fmt: skip
    if not many:
        axes.plot(mark.x, mark.y, "o", color=colour, markersize=2.2, markeredgewidth=0, zorder=order)
    axes.axhline(0.0, color=SURROUNDINGS["axes"][0], linewidth=0.6, zorder=1)


@draw_mark.register(Histogram)
def _(mark: Histogram, axes: "Axes", order: float) -> None:
    axes.stairs(
        mark.counts, mark.edges, fill=True, facecolor=COLOURS[mark.colour], edgecolor="white", linewidth=0, alpha=0.75,
        label=escape_label(mark.label), zorder=order,
    )  # fmt: skip


@draw_mark.register(HLine)
def _(mark: HLine, axes: "Axes", order: float) -> None:
    axes.axhline(mark.y, **_stroke(mark, order))


@draw_mark.register(VLine)
def _(mark: VLine, axes: "Axes", order: float) -> None:
    axes.axvline(mark.x, **_stroke(mark, order))


@draw_mark.register(HBand)
def _(mark: HBand, axes: "Axes", order: float) -> None:
    axes.axhspan(mark.lower, mark.upper, **_fill(mark, 0.22, 1.2))
    for edge in (mark.lower, mark.upper):  # above the marks, which would hide a narrow band
        axes.axhline(edge, color=COLOURS[mark.colour], linewidth=0.5, zorder=3)


@draw_mark.register(VSpan)
def _(mark: VSpan, axes: "Axes", order: float) -> None:
    axes.axvspan(mark.start, mark.end, **_fill(mark, 0.18, 1.1))


@draw_mark.register(Reference)
def _(mark: Reference, axes: "Axes", order: float) -> None:
    axes.axline((0.0, mark.intercept), slope=mark.slope, **_stroke(mark, order))


@draw_mark.register(Tiles)
def _(mark: Tiles, axes: "Axes", order: float) -> None:
    n = len(mark.names)
    for k, value in enumerate(mark.value.tolist()):
        row, column = divmod(k, n)
        colour = COLOURS[mark.colour if value >= 0 else mark.opposite]
        corners = [column - 0.48, column + 0.48], [row - 0.48] * 2, [row + 0.48] * 2
        axes.fill_between(*corners, color=colour, alpha=0.6 * min(abs(value), 1.0), linewidth=0, zorder=order)
        axes.text(
            column, row, f"{round(value, 2) + 0.0:.2f}".replace("-", MINUS), ha="center", va="center", zorder=order + 1
        )
    axes.set_xticks(range(n), [name.partition(" ")[0] for name in mark.names], parse_math=False)
    axes.set_yticks(range(n), mark.names, parse_math=False)
    axes.set(xlim=(-0.5, n - 0.5), ylim=(n - 0.5, -0.5))
    axes.grid(visible=False)


def draw_bars(bars: Sequence[Bars], axes: "Axes") -> None:
    """Draw the Bars of a panel side by side over their shared names."""
    width = 0.8 / max(len(bars), 1)
    for i, mark in enumerate(bars):
        middle = np.arange(len(mark.names)) + (i - (len(bars) - 1) / 2) * width
        axes.bar(
            middle, mark.heights, 0.92 * width, yerr=mark.std, color=COLOURS[mark.colour],
            label=escape_label(mark.label),
            error_kw={"elinewidth": 0.9, "capsize": 2, "ecolor": SURROUNDINGS["words"][0]},
        )  # fmt: skip
    if bars:
        axes.set_xticks(range(len(bars[0].names)), bars[0].names, parse_math=False)
        axes.grid(visible=False, axis="x")


@singledispatch
def draw_mark_3d(mark: Any, axes: "Axes3D") -> None:
    """Draw one mark in space."""
    raise TypeError(f"{type(mark).__name__} cannot be drawn in space")


@draw_mark_3d.register(Line3D)
def _(mark: Line3D, axes: "Axes3D") -> None:
    axes.plot(
        mark.x, mark.y, mark.z, color=COLOURS[mark.colour], linewidth=1.4, linestyle=DASHES[mark.style],
        label=escape_label(mark.label),
    )  # fmt: skip


@draw_mark_3d.register(Points3D)
def _(mark: Points3D, axes: "Axes3D") -> None:
    axes.plot(mark.x, mark.y, mark.z, "o", color=COLOURS[mark.colour], markersize=4, label=escape_label(mark.label))
    for x, y, z, name in zip(mark.x, mark.y, mark.z, mark.names, strict=False):
        axes.text(x, y, z, f"  {name}", fontsize=8.5, parse_math=False)
