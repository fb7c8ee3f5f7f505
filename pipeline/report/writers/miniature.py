"""A figure in at most 3 kB: what hundreds of runs leave room for.  Lines, bands and windows, no axes but their ends."""

from html import escape

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.report.content import Band, Figure, HBand, HLine, Line, Panel, VSpan
from pipeline.report.content.inline import printable
from pipeline.report.figures.palette import COLOURS, DARK, SURROUNDINGS, assign_looks
from pipeline.report.figures.traces import thin_mark

WIDTH, HEIGHT = 600, 60  # of a panel [px]
LEFT, BELOW = 70, 16  # [px] for what its ends of y and of x are
LEAST, POINTS = 12, 170  # of a line, and of all lines of a figure
LETTERS = 40  # of a title
DASHES = {"dashed": "4 2", "dotted": "1 2", "dashdot": "5 2 1 2"}
Box = tuple[float, float, float, float]


def miniature(figure: Figure) -> str:
    """The SVG of a small figure; marks of other kinds than lines, bands and windows are left out."""
    curves = sum(isinstance(mark, Line | Band) for panel in figure.panels for mark in panel.marks)
    points = max(LEAST, POINTS // max(curves, 1))
    height = (HEIGHT + BELOW) * len(figure.panels)
    panels = "".join(_panel(panel, i * (HEIGHT + BELOW), points) for i, panel in enumerate(figure.panels))
    words, dark_words = SURROUNDINGS["words"]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}">'
        f"<style>text{{font:11px sans-serif;fill:{words}}}{_colours(COLOURS, panels)}"
        f"@media(prefers-color-scheme:dark){{text{{fill:{dark_words}}}{_colours(DARK, panels)}}}</style>{panels}</svg>"
    )


def _colours(side: dict[str, str], panels: str) -> str:
    """The colours that the panels use, as CSS."""
    return "".join(f".{name}{{color:{value}}}" for name, value in side.items() if f'class="{name}"' in panels)


def _panel(panel: Panel, top: float, points: int) -> str:
    marks = [thin_mark(mark, points) for mark in assign_looks(panel.marks)]
    curves = [mark for mark in marks if isinstance(mark, Line | Band) and len(mark.x)]
    if not curves:
        return ""
    ys = [y for mark in curves for y in ([mark.y] if isinstance(mark, Line) else [mark.lower, mark.upper])]
    x_low, x_high = panel.x_range or _ends([mark.x for mark in curves])
    y_low, y_high = panel.y_range or _ends(ys)
    box = (x_low, x_high, y_low, y_high)
    title = escape(printable(panel.title[:LETTERS]))
    words = (
        f'<text x="{LEFT}" y="{top + 11}">{title}</text>'
        f'<text x="{LEFT - 4}" y="{top + 22}" text-anchor="end">{y_high:.3g}</text>'
        f'<text x="{LEFT - 4}" y="{top + HEIGHT}" text-anchor="end">{y_low:.3g}</text>'
        f'<text x="{LEFT}" y="{top + HEIGHT + 12}">{x_low:.4g}</text>'
        f'<text x="{WIDTH}" y="{top + HEIGHT + 12}" text-anchor="end">'
        f"{x_high:.4g} {escape(printable(panel.x_label[:LETTERS]))}</text>"
    )
    return words + "".join(_mark(mark, box, top) for mark in marks)


def _ends(columns: list[Array]) -> tuple[float, float]:
    """The least and the greatest of all values, apart."""
    values = np.concatenate(columns)
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _mark(mark: object, box: Box, top: float) -> str:
    x_low, x_high, y_low, y_high = box
    match mark:
        case Line():
            return _line(mark, mark.x, mark.y, box, top)
        case HLine():
            return _line(mark, np.array([x_low, x_high]), np.full(2, mark.y), box, top)
        case Band():
            x, y = np.r_[mark.x, mark.x[::-1]], np.r_[mark.upper, mark.lower[::-1]]
        case VSpan():
            x, y = np.repeat([mark.start, mark.end], 2), np.array([y_low, y_high, y_high, y_low])
        case HBand():
            x, y = np.repeat([x_low, x_high], 2), np.array([mark.lower, mark.upper, mark.upper, mark.lower])
        case _:
            return ""
    return f'<path class="{mark.colour}" fill="currentColor" opacity=".22" d="{_path(x, y, box, top)}"/>'


def _line(mark: Line | HLine, x: Array, y: Array, box: Box, top: float) -> str:
    dash = f' stroke-dasharray="{DASHES[mark.style]}"' if mark.style in DASHES else ""
    path = _path(x, y, box, top)
    return f'<path class="{mark.colour}" fill="none" stroke="currentColor"{dash} d="{path}"/>'


def _path(x: Array, y: Array, box: Box, top: float) -> str:
    """The path through points in whole pixels, cut at the edges and broken where there is no number."""
    x_low, x_high, y_low, y_high = box
    across = LEFT + np.clip((x - x_low) / (x_high - x_low), 0, 1) * (WIDTH - LEFT)
    up = top + 14 + np.clip((y_high - y) / (y_high - y_low), 0, 1) * (HEIGHT - 14)
    steps, down = [], False
    for column, row in zip(across, up, strict=True):
        if np.isfinite(column + row):
            steps.append(f"{'L' if down else 'M'}{column:.0f} {row:.0f}")
        down = bool(np.isfinite(column + row))
    return "".join(steps)
