"""How matplotlib draws each mark: one function per mark, all with the same arguments."""

from collections.abc import Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report.content.marks import (
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
    VLine,
    VSpan,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D

DASHES: dict[str, Any] = {"solid": "-", "dashed": (0, (4, 2)), "dotted": (0, (1, 1.6))}


def escape_label(text: str) -> str:
    """A label that matplotlib keeps even when it begins with an underscore; `unescape_label` undoes it."""
    return f" {text}" if text else ""


def unescape_label(text: str) -> str:
    """The text that `escape_label` was given."""
    return text.removeprefix(" ")


@singledispatch
def draw_mark(mark: Any, axes: "Axes", colour: str, order: float) -> None:
    """Draw one mark on matplotlib axes."""
    raise TypeError(f"{type(mark).__name__} cannot be drawn")


@draw_mark.register(Line)
def _(mark: Line, axes: "Axes", colour: str, order: float) -> None:
    axes.plot(
        mark.x, mark.y, color=colour, linewidth=0.9, linestyle=DASHES[mark.style], label=escape_label(mark.label),
        zorder=order,
    )  # fmt: skip


@draw_mark.register(Points)
def _(mark: Points, axes: "Axes", colour: str, order: float) -> None:
    axes.errorbar(
        mark.x, mark.y, mark.y_std, fmt="o", markersize=2.6, markeredgewidth=0, color=colour, elinewidth=0.9, capsize=2,
        label=escape_label(mark.label), zorder=order,
    )  # fmt: skip
    for x, y, name in zip(mark.x, mark.y, mark.names, strict=False):
        axes.annotate(
            name, (x, y), (0, 4 if y >= 0 else -4), textcoords="offset points", ha="center",
            va="bottom" if y >= 0 else "top", fontsize=8, color=colour, parse_math=False, zorder=order + 1,
        )  # fmt: skip
    if mark.names:
        low, high = axes.get_ylim()
        axes.set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))  # room for the names


@draw_mark.register(Band)
def _(mark: Band, axes: "Axes", colour: str, order: float) -> None:
    axes.fill_between(
        mark.x, mark.lower, mark.upper, color=colour, alpha=0.25, linewidth=0, label=escape_label(mark.label),
        zorder=1.5,
    )  # fmt: skip


@draw_mark.register(Stems)
def _(mark: Stems, axes: "Axes", colour: str, order: float) -> None:
    axes.vlines(mark.x, 0.0, mark.y, color=colour, linewidth=0.9, label=escape_label(mark.label), zorder=order)
    axes.plot(mark.x, mark.y, "o", color=colour, markersize=2.2, markeredgewidth=0, zorder=order)
    axes.axhline(0.0, color="#555555", linewidth=0.6, zorder=1)


@draw_mark.register(Histogram)
def _(mark: Histogram, axes: "Axes", colour: str, order: float) -> None:
    axes.stairs(
        mark.counts, mark.edges, fill=True, facecolor=colour, edgecolor="white", linewidth=0, alpha=0.75,
        label=escape_label(mark.label), zorder=order,
    )  # fmt: skip


@draw_mark.register(HLine)
def _(mark: HLine, axes: "Axes", colour: str, order: float) -> None:
    axes.axhline(
        mark.y, color=colour, linewidth=0.9, linestyle=DASHES[mark.style], label=escape_label(mark.label), zorder=order
    )


@draw_mark.register(VLine)
def _(mark: VLine, axes: "Axes", colour: str, order: float) -> None:
    axes.axvline(
        mark.x, color=colour, linewidth=0.9, linestyle=DASHES[mark.style], label=escape_label(mark.label), zorder=order
    )


@draw_mark.register(HBand)
def _(mark: HBand, axes: "Axes", colour: str, order: float) -> None:
    axes.axhspan(
        mark.lower, mark.upper, color=colour, alpha=0.18, linewidth=0, label=escape_label(mark.label), zorder=1.2
    )


@draw_mark.register(VSpan)
def _(mark: VSpan, axes: "Axes", colour: str, order: float) -> None:
    axes.axvspan(
        mark.start, mark.end, color=colour, alpha=0.18, linewidth=0, label=escape_label(mark.label), zorder=1.1
    )


@draw_mark.register(Reference)
def _(mark: Reference, axes: "Axes", colour: str, order: float) -> None:
    axes.axline(
        (0.0, mark.intercept), slope=mark.slope, color=colour, linewidth=0.9, linestyle=DASHES[mark.style],
        label=escape_label(mark.label), zorder=order,
    )  # fmt: skip


def draw_bars(bars: Sequence[tuple[Bars, str]], axes: "Axes") -> None:
    """Draw the Bars of a panel side by side over their shared names."""
    width = 0.8 / max(len(bars), 1)
    for i, (mark, colour) in enumerate(bars):
        middle = np.arange(len(mark.names)) + (i - (len(bars) - 1) / 2) * width
        axes.bar(
            middle, mark.heights, 0.92 * width, yerr=mark.std, color=colour, label=escape_label(mark.label),
            error_kw={"elinewidth": 0.9, "capsize": 2, "ecolor": "#333333"},
        )  # fmt: skip
    if bars:
        axes.set_xticks(range(len(bars[0][0].names)), bars[0][0].names, parse_math=False)
        axes.grid(visible=False, axis="x")


@singledispatch
def draw_mark_3d(mark: Any, axes: "Axes3D", colour: str) -> None:
    """Draw one mark in space."""
    raise TypeError(f"{type(mark).__name__} cannot be drawn in space")


@draw_mark_3d.register(Line3D)
def _(mark: Line3D, axes: "Axes3D", colour: str) -> None:
    axes.plot(
        mark.x, mark.y, mark.z, color=colour, linewidth=1.4, linestyle=DASHES[mark.style],
        label=escape_label(mark.label),
    )  # fmt: skip


@draw_mark_3d.register(Points3D)
def _(mark: Points3D, axes: "Axes3D", colour: str) -> None:
    axes.plot(mark.x, mark.y, mark.z, "o", color=colour, markersize=4, label=escape_label(mark.label))
    for x, y, z, name in zip(mark.x, mark.y, mark.z, mark.names, strict=False):
        axes.text(x, y, z, f"  {name}", fontsize=8.5, parse_math=False)
