"""Thinning figures to what a page can carry, and what is said of it."""

from dataclasses import dataclass, replace

from davinci_forces.report.content import Figure, Figure3D
from davinci_forces.report.content.thinning import points_of, thin_mark


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
    sizes = [points_of(mark) for panel in figure.panels for mark in panel.marks]
    shares = iter(_share_points(sizes, limit))
    panels = tuple(
        replace(panel, marks=tuple(thin_mark(m, next(shares)) for m in panel.marks)) for panel in figure.panels
    )
    result = replace(figure, panels=panels)
    return ThinnedFigure(result, figure.samples, result.samples)


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
