"""The numbers of a figure, in as many points as a page can hold; the page draws them and saves them as CSV."""

import base64
import json
import math
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content import Figure, Figure3D, Panel
from davinci_forces.report.content.thinning import is_sorted, points_of, thin_mark
from davinci_forces.report.figures.palette import assign_looks
from davinci_forces.report.figures.space import LABELS

Json = dict[str, Any]
AnyFigure = TypeVar("AnyFigure", Figure, Figure | Figure3D)
PIXELS = 96 / 25.4  # of CSS in a millimetre
CODES = 2**16 - 2  # steps of a range that two bytes tell apart; one more code is for missing values
FEW_VALUES = 64  # a column of fewer is written in full
CODED_STEPS = 8  # between neighbouring samples of a column that increases


def numbers_json(figure: Figure | Figure3D) -> str:
    """The figure as JSON."""
    columns: dict[str, int] = {}  # encoded column -> its index; marks share equal columns
    if isinstance(figure, Figure):
        panels = figure.panels
    else:  # marks in space, in the form of a panel's marks
        panels = (Panel("", LABELS[0], ", ".join(LABELS[1:]), figure.marks),)  # type: ignore[arg-type]
    content = {
        "across": figure.columns if isinstance(figure, Figure) else 1,
        "height": round(figure.height * PIXELS),
        "panels": [_panel(panel, columns) for panel in panels],
        "columns": [json.loads(column) for column in columns],
    }
    return json_of(content)


def json_of(content: Any) -> str:
    """Data of the page as JSON without any text that could close the HTML element around it."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _panel(panel: Panel, columns: dict[str, int]) -> Json:
    own = {field.name: _plain(getattr(panel, field.name)) for field in fields(panel) if field.name != "marks"}
    linear = not (panel.x_log or panel.y_log)
    return own | {"marks": [_mark(mark, columns, linear) for mark in assign_looks(panel.marks)]}


def _mark(mark: Any, columns: dict[str, int], linear: bool) -> Json:
    values = {field.name: getattr(mark, field.name) for field in fields(mark)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    places = {name: columns.setdefault(_encode(array, linear), len(columns)) for name, array in arrays.items()}
    others = {name: _plain(value) for name, value in values.items() if name not in arrays and value not in (None, ())}
    return {"kind": type(mark).__name__, "columns": places} | others


def _plain(value: Any) -> Any:
    """A value for JSON, without NaN or infinity."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _encode(column: Array, linear: bool) -> str:
    """A column as JSON: start, step and count where its steps are equal, else its bits in base 64.

    On linear axes, values are rounded to `CODES` steps over their range, which no page resolves (h), if neighbouring
    samples stay apart.  Otherwise single precision (f) if it distinguishes these, else double (d).
    """
    if (step := _equal_step(column)) is not None:
        return json.dumps([float(column[0]), step, len(column)])
    known = column[np.isfinite(column)]
    low, step = (float(known.min()), float(np.ptp(known)) / CODES) if len(known) else (0.0, 0.0)
    is_coarse = linear and len(column) > FEW_VALUES and step > 0
    if is_coarse and (CODED_STEPS * step <= _typical_step(column) or not is_sorted(known)):
        codes = np.where(np.isfinite(column), np.rint((column - low) / step), CODES + 1).astype("<u2")
        return json.dumps(f"h{low!r},{step!r},{base64.b64encode(codes.tobytes()).decode()}")
    close = float(np.nanmax(np.abs(column), initial=0.0)) > 2**20 * _typical_step(column)
    letter, form = ("d", "<f8") if close else ("f", "<f4")
    return json.dumps(letter + base64.b64encode(column.astype(form).tobytes()).decode())


def _equal_step(column: Array) -> float | None:
    """The step between equidistant samples, to a millionth of the step."""
    if len(column) < 3 or not np.isfinite(column).all() or column[-1] == column[0]:
        return None
    step = float(column[-1] - column[0]) / (len(column) - 1)
    even = column[0] + step * np.arange(len(column))
    return step if float(np.max(np.abs(column - even))) <= 1e-6 * abs(step) else None


def _typical_step(column: Array) -> float:
    steps = np.abs(np.diff(column[np.isfinite(column)]))
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else math.inf


def thin_figure(figure: AnyFigure, limit: int) -> AnyFigure:
    """Share `limit` points fairly between the marks of a figure; marks that need less than their share keep all."""
    if isinstance(figure, Figure3D):
        return figure
    sizes = [points_of(mark) for panel in figure.panels for mark in panel.marks]
    shares = iter(_share_points(sizes, limit))
    thinned = ((panel, tuple(thin_mark(mark, next(shares)) for mark in panel.marks)) for panel in figure.panels)
    return replace(figure, panels=tuple(replace(panel, marks=marks) for panel, marks in thinned))


def thinning_note(samples: int, shown: int) -> str:
    """The remark below the caption of a figure that shows so many points of its samples."""
    if shown == samples:
        return f"All {_group_digits(samples)} points are shown."
    return f"Min–max envelopes: {_group_digits(shown)} points for the {_group_digits(samples)} of all curves."


def _share_points(sizes: list[int], limit: int) -> list[int]:
    """Points for each mark: what it needs while that is below an equal share of what the greedier ones leave."""
    shares, left = [0] * len(sizes), limit
    order = sorted(range(len(sizes)), key=lambda i: sizes[i])
    for rank, i in enumerate(order):
        shares[i] = min(sizes[i], left // (len(order) - rank))
        left -= shares[i]
    return shares


def _group_digits(count: int) -> str:
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
