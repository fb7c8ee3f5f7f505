"""Shapes and words of a picture as SVG, in points; whole paths in few characters."""

import re
from html import escape

import numpy as np

from davinci_forces.maths.arrays import Array, runs

POINT = 72 / 25.4  # points in a millimetre
LINE_HEIGHT = 3.9  # [mm] height of a line of a label or a row of a legend
LONG = 200  # points of a path whose steps are in tenths of a point, not hundredths
FAR = 5000.0  # [pt] beyond every page
WORDS_FONT = "DejaVu Sans"
SMALL_SIZE, NORMAL_SIZE, TITLE_SIZE = 8.0, 8.5, 9.0  # [pt] sizes of words: numbers, labels, titles


def trace(x: Array, y: Array, closed: bool = False) -> str:
    """The path through points [pt], interrupted where one is not finite, in relative steps."""
    scale = 10 if len(x) > LONG else 100
    ends = "z" if closed else ""
    return "".join(_run(x[run], y[run], scale) + ends for run in runs(np.isfinite(x) & np.isfinite(y)))


def _run(x: Array, y: Array, scale: int) -> str:
    places = np.rint(np.clip(np.stack([x, y], axis=1), -FAR, FAR) * scale).astype(np.int64)
    steps = np.diff(places, axis=0)
    steps = steps[np.any(steps != 0, axis=1)]
    numbers = _joined((steps.ravel() / scale).tolist())
    start = f"M{places[0, 0] / scale:g} {places[0, 1] / scale:g}"
    return f"{start}l{numbers}" if numbers else start


def _joined(numbers: list[float]) -> str:
    """Numbers with a space only where a reader of paths needs it: not before a sign, nor between two points."""
    text = re.sub(r"\b0\.", ".", " ".join(f"{n:g}" for n in numbers))
    return re.sub(r" (?=-)|(?<=\.\d) (?=\.)|(?<=\.\d\d) (?=\.)", "", text)


def symbols(x: Array, y: Array) -> str:
    """The path of points [pt], each so short that a round end of its line makes it a symbol."""
    places = np.rint(10 * np.clip(np.stack([x, y], axis=1)[np.isfinite(x + y)], -FAR, FAR)) / 10
    return "".join(f"M{a:g} {b:g}h.1" for a, b in places.tolist())


def path(d: str, style: str) -> str:
    """A path element with a style; nothing for an empty path."""
    return f'<path d="{d}" style="{style}"/>' if d else ""


def words(
    x: float, y: float, text: str, colour: str, size: float = NORMAL_SIZE, anchor: str = "start", bold: bool = False,
    turned: bool = False, halo: str = "",
) -> str:  # fmt: skip
    """One line of words, with its baseline at y [pt]; `turned` ones run upwards, a `halo` covers lines behind them."""
    if not text:
        return ""
    weight = "; font-weight: bold" if bold else ""
    weight += f"; paint-order: stroke; stroke: {halo}; stroke-width: 2.5; stroke-linejoin: round" if halo else ""
    turn = f' transform="rotate(-90 {x:.2f} {y:.2f})"' if turned else ""
    style = f"font-size: {size:g}px; font-family: {WORDS_FONT}; text-anchor: {anchor}; fill: {colour}{weight}"
    return f'<text x="{x:.2f}" y="{y:.2f}"{turn} style="{style}">{escape(text, quote=False)}</text>'
