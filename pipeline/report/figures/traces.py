"""Thinning traces to what a page can carry, without hiding an extreme."""

from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from pipeline.maths.arrays import Array
from pipeline.report.content import Figure, Figure3D
from pipeline.report.content.marks import AnyMark, Band, Line, Points, Stems

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class ThinnedFigure:
    """A figure of few enough points, and how many it had."""

    figure: Figure | Figure3D
    samples: int
    shown: int

    @property
    def note(self) -> str:
        """The remark on it below its caption."""
        if self.shown == self.samples:
            return f"All {_group_digits(self.samples)} samples are shown."
        return f"Min–max envelope of {_group_digits(self.samples)} samples in {_group_digits(self.shown)} points."


def thin_figure(figure: Figure | Figure3D, limit: int) -> ThinnedFigure:
    """Share `limit` points fairly between the marks of a figure; marks that need less than their share keep all.

    One in space is left as it is.
    """
    if isinstance(figure, Figure3D):
        samples = sum(len(mark.x) for mark in figure.marks)
        return ThinnedFigure(figure, samples, samples)
    sizes = [_size(mark) for panel in figure.panels for mark in panel.marks]
    shares = iter(_share_points(sizes, limit))
    panels = tuple(
        replace(panel, marks=tuple(thin_mark(m, next(shares)) for m in panel.marks)) for panel in figure.panels
    )
    result = replace(figure, panels=panels)
    return ThinnedFigure(result, _count_points(figure), _count_points(result))


@singledispatch
def thin_mark(mark: AnyMark, limit: int) -> AnyMark:
    """The mark in at most `limit` points; those of few numbers stay as they are."""
    return mark


@thin_mark.register(Line)
def _(mark: Line, limit: int) -> AnyMark:
    kept = _kept_indices(mark.x, mark.y, limit)
    return replace(mark, x=mark.x[kept], y=mark.y[kept])


@thin_mark.register(Stems)
def _(mark: Stems, limit: int) -> AnyMark:
    kept = _kept_indices(mark.x, mark.y, limit)
    return replace(mark, x=mark.x[kept], y=mark.y[kept])


@thin_mark.register(Points)
def _(mark: Points, limit: int) -> AnyMark:
    kept = _kept_indices(mark.x, mark.y, limit)
    return replace(mark, x=mark.x[kept], y=mark.y[kept], y_std=None if mark.y_std is None else mark.y_std[kept])


@thin_mark.register(Band)
def _(mark: Band, limit: int) -> AnyMark:
    if 2 * len(mark.x) <= limit or not is_sorted(mark.x):
        return mark
    starts = _range_starts(mark.x, limit // 2)
    lower, upper = np.fmin.reduceat(mark.lower, starts), np.fmax.reduceat(mark.upper, starts)
    return replace(mark, x=mark.x[starts], lower=lower, upper=upper)


def envelope(x: Array, y: Array, bins: int) -> Indices:
    """Where the least and the greatest sample of each of `bins` equal ranges of x are, in order.

    An extreme is never lost, however short; a range without a finite sample keeps one, so that a gap stays a gap.
    x (N,) must not decrease; returns (n,) indices, n <= 2 bins.
    """
    starts = _range_starts(x, bins)
    ranges = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(x)))
    below, above = np.where(np.isnan(y), np.inf, y), np.where(np.isnan(y), -np.inf, y)
    least = below == np.minimum.reduceat(below, starts)[ranges]
    greatest = above == np.maximum.reduceat(above, starts)[ranges]
    return np.unique(np.concatenate([_first_of_each(least, ranges), _first_of_each(greatest, ranges)]))


def _first_of_each(chosen: NDArray[np.bool_], ranges: Indices) -> Indices:
    """The first chosen sample of each range."""
    places = np.flatnonzero(chosen)
    return places[np.unique(ranges[places], return_index=True)[1]]


def _range_starts(x: Array, bins: int) -> Indices:
    """The first sample of each of the equal ranges of x that hold any."""
    ranges = np.minimum((x - x[0]) / ((x[-1] - x[0]) or 1.0) * bins, bins - 1).astype(int)
    return np.flatnonzero(np.diff(ranges, prepend=-1))


def _kept_indices(x: Array, y: Array, limit: int) -> Indices:
    if len(x) <= limit:
        return np.arange(len(x))
    if is_sorted(x):
        return envelope(x, y, limit // 2)
    return np.arange(0, len(x), -(-len(x) // limit))


def is_sorted(x: Array) -> bool:
    """Whether x never decreases, as time does."""
    return bool(np.all(np.diff(x) >= 0))


def _share_points(sizes: list[int], limit: int) -> list[int]:
    """Points for each mark: what it needs while that is below an equal share of what the greedier ones leave."""
    shares, left = [0] * len(sizes), limit
    order = sorted(range(len(sizes)), key=lambda i: sizes[i])
    for rank, i in enumerate(order):
        shares[i] = min(sizes[i], left // (len(order) - rank))
        left -= shares[i]
    return shares


def _count_points(figure: Figure) -> int:
    return sum(_size(mark) for panel in figure.panels for mark in panel.marks)


def _size(mark: AnyMark) -> int:
    """Points that a mark puts on the page: two for each sample of a band."""
    return len(mark.x) * (2 if isinstance(mark, Band) else 1) if isinstance(mark, Line | Points | Band | Stems) else 0


def _group_digits(count: int) -> str:
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
