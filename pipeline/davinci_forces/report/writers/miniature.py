"""Draw figures in few bytes: a report of hundreds of runs has no room or time for more.

A figure has lines, bands, points, windows, a legend and the ends of the axes; other marks are left out.
"""

from dataclasses import dataclass
from html import escape

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content import Band, Figure, HBand, HLine, Line, Panel, Points, VSpan
from davinci_forces.report.content.inline import printable
from davinci_forces.report.content.marks import AnyMark
from davinci_forces.report.content.thinning import thin_mark
from davinci_forces.report.figures.palette import COLOURS, DARK, SURROUNDINGS, assign_looks

WIDTH, LEFT, LINE, LETTER = 640, 64, 15, 6.2  # [px] figure, space left of axes, line of text, character
LETTERS = 60  # characters of a title or a label
MIN_LINE_POINTS = 12
DASHES = {"dashed": "4 2", "dotted": "1 2", "dashdot": "5 2 1 2"}
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Scale:
    """Size of a figure: the height of its axes [px], the points of all its curves, and whether it has a legend."""

    height: int
    points: int
    legend: bool


SMALL = Scale(44, 170, legend=False)  # at most 3 kB
LARGER = Scale(110, 2400, legend=True)  # the picture of a trace that is on screen only


def miniature(figure: Figure, scale: Scale = SMALL) -> str:
    """The SVG of a figure."""
    curves = [mark for panel in figure.panels for mark in _curves(panel)]
    points = max(MIN_LINE_POINTS, scale.points // max(len(curves), 1))
    across = _ends([mark.x for mark in curves]) if figure.zoomable else None
    top, panels = 0, ""
    for panel in figure.panels:
        drawn, height = _panel(panel, top, points, scale, across)
        top, panels = top + height, panels + drawn
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{top}" viewBox="0 0 {WIDTH} {top}">'
        "<style>path{fill:none;stroke:currentColor}.area{fill:currentColor;stroke:none;opacity:.24}"
        f"text{{font:11px sans-serif}}{_colours(COLOURS, 0, panels)}"
        f"@media(prefers-color-scheme:dark){{{_colours(DARK, 1, panels)}}}</style>{panels}</svg>"
    )


def _colours(marks: dict[str, str], side: int, panels: str) -> str:
    """The colours that the panels use, as CSS; `side` is 0 on a light page, 1 on a dark one."""
    used = "".join(f".{name}{{color:{value}}}" for name, value in marks.items() if f'class="{name}' in panels)
    return f"text{{fill:{SURROUNDINGS['words'][side]}}}.axes{{color:{SURROUNDINGS['axes'][side]}}}{used}"


def _panel(panel: Panel, top: float, points: int, scale: Scale, across: tuple[float, float] | None) -> tuple[str, int]:
    """A panel below `top`, and its height [px]."""
    marks = [thin_mark(mark, points) for mark in assign_looks(panel.marks)]
    legend, rows = _legend(marks, top + LINE) if scale.legend else ("", 0)
    above = LINE * (rows + 1) + 2
    box = _box(panel, across)
    low, high = top + above + scale.height, top + above
    words = (
        _text(LEFT, top + 11, ": ".join(filter(None, (panel.title, panel.y_label))), "start")
        + _text(LEFT - 4, high + 8, f"{box[3]:.3g}", "end")
        + _text(LEFT - 4, low, f"{box[2]:.3g}", "end")
        + _text(LEFT, low + 12, f"{box[0]:.4g}", "start")
        + _text(WIDTH, low + 12, f"{box[1]:.4g} {panel.x_label}", "end")
        + f'<path class="axes" d="M{LEFT} {high}V{low}H{WIDTH}"/>'
    )
    return words + legend + "".join(_mark(mark, box, high, scale.height) for mark in marks), above + scale.height + LINE


def _text(x: float, y: float, words: str, anchor: str) -> str:
    shown = escape(printable(words[:LETTERS]), quote=False)
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}">{shown}</text>' if shown else ""


def _legend(marks: list[AnyMark], top: float) -> tuple[str, int]:
    """The labels of marks in rows, each after a sample of its mark, and the number of rows."""
    drawn, x, rows = "", float(LEFT), 0
    for mark in marks:
        if mark.label:
            width = 34 + LETTER * min(len(mark.label), LETTERS)
            if not rows or x + width > WIDTH:
                x, rows = float(LEFT), rows + 1
            y = top + LINE * rows - 4
            area = " area" if isinstance(mark, Band | HBand | VSpan) else ""
            sample = f"M{x:.0f} {y - 4:g}h18" + ("v-5h-18" if area else "")
            drawn += (
                f'<path class="{mark.colour}{area}"{_dash(mark)} d="{sample}"/>{_text(x + 22, y, mark.label, "start")}'
            )
            x += width
    return drawn, rows


def _box(panel: Panel, across: tuple[float, float] | None) -> Box:
    """The ranges of x (`across`, if given) and of y."""
    curves = _curves(panel)
    ys = [y for mark in curves for y in ([mark.lower, mark.upper] if isinstance(mark, Band) else [mark.y])]
    return (*(across or panel.x_range or _ends([mark.x for mark in curves])), *(panel.y_range or _ends(ys)))


def _curves(panel: Panel) -> list[Line | Band | Points]:
    return [mark for mark in panel.marks if isinstance(mark, Line | Band | Points)]


def _ends(columns: list[Array]) -> tuple[float, float]:
    """The smallest and the largest of all values, widened if they are equal."""
    values = np.concatenate([*columns, np.empty(0)])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _mark(mark: AnyMark, box: Box, top: float, height: float) -> str:
    x_low, x_high, y_low, y_high = box
    area = ""
    match mark:
        case Line():
            x, y = mark.x, mark.y
        case HLine():
            x, y = np.array([x_low, x_high]), np.full(2, mark.y)
        case Points():
            return _dots(mark, box, top, height)
        case Band():
            x, y, area = np.r_[mark.x, mark.x[::-1]], np.r_[mark.upper, mark.lower[::-1]], " area"
        case VSpan():
            x, y, area = np.repeat([mark.start, mark.end], 2), np.array([y_low, y_high, y_high, y_low]), " area"
        case HBand():
            x, y, area = np.repeat([x_low, x_high], 2), np.array([mark.lower, *[mark.upper] * 2, mark.lower]), " area"
        case _:
            return ""
    return f'<path class="{mark.colour}{area}"{_dash(mark)} d="{_path(x, y, box, top, height)}"/>'


def _dash(mark: AnyMark) -> str:
    style = mark.style if isinstance(mark, Line | HLine) else ""
    return f' stroke-dasharray="{DASHES[style]}"' if style in DASHES else ""


def _dots(mark: Points, box: Box, top: float, height: float) -> str:
    across, up = _place(mark.x, mark.y, box, top, height)
    dots = "".join(f"M{a - 1:.0f} {b:.0f}h2" for a, b in zip(across, up, strict=True) if np.isfinite(a + b))
    return f'<path class="{mark.colour}" stroke-width="2" d="{dots}"/>'


def _place(x: Array, y: Array, box: Box, top: float, height: float) -> tuple[Array, Array]:
    """Points in pixels, cut at the edges."""
    x_low, x_high, y_low, y_high = box
    across = LEFT + np.clip((x - x_low) / (x_high - x_low), 0, 1) * (WIDTH - LEFT)
    return across, top + np.clip((y_high - y) / (y_high - y_low), 0, 1) * height


def _path(x: Array, y: Array, box: Box, top: float, height: float) -> str:
    """The path through points in whole pixels, interrupted at values that are not finite."""
    steps, here = [], None
    for a, b in zip(*_place(x, y, box, top, height), strict=True):
        if not np.isfinite(a + b):
            here = None
            continue
        there = (round(a), round(b))
        if here is None:
            steps.append(f"M{there[0]} {there[1]}l")
        elif there != here:
            step = f"{there[0] - here[0]} {there[1] - here[1]}".replace(" -", "-")
            steps.append(step if step.startswith("-") or steps[-1].endswith("l") else f" {step}")
        here = there
    return "".join(steps).replace("lM", "M").removesuffix("l")
