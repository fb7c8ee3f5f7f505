"""What every section is handed: the records, the results, and how to name things."""

from dataclasses import dataclass

import numpy as np

from pipeline.catalogue import Catalogue, Provenance
from pipeline.quantities import QUANTITIES
from pipeline.records import Column, Record, Track
from pipeline.report.content import Number, literal
from pipeline.report.results import Results, printed
from pipeline.study import Study


@dataclass(frozen=True)
class Context:
    """One study, ready to be reported."""

    catalogue: Catalogue
    study: Study
    results: Results
    provenance: Provenance

    def number(self, key: str, digits: int = 4) -> Number | str:
        """The result of that key as a cell, or a dash where there is none."""
        return self.results[key].number(digits) if key in self.results else "–"

    def count(self, key: str) -> Number | str:
        """The result of that key, which is a whole number, as a cell."""
        return self.number(key, len(str(round(self.results[key].value))) if key in self.results else 1)


def most_telling(tracks: list[Track], most: int) -> list[Track]:
    """The tracks that figures are spent on, in their order: contacts first, then validation, then identification.

    A report of many logs would otherwise be too large to open, and its contacts hard to find.
    """
    order = ("contact", "weight", "tissue", "validation", "identification")
    moving = [track for track in tracks if not track.held]
    ranked = sorted(moving, key=lambda track: order.index(track.role) if track.role in order else len(order))
    return [track for track in moving if track in ranked[:most]]


def title(name: str) -> str:
    """The name of a log or joint as a heading: 'hand_roll' is 'Hand roll'."""
    words = literal(name.replace("_", " "))
    return words[:1].upper() + words[1:]


def label(record: Record, field: str, meaning: str = "") -> str:
    """The label of an axis: what a field means and its unit."""
    unit = record.origin.units.get(field, "") if record.origin else ""
    words = meaning or QUANTITIES[field].meaning
    return f"{words} [{printed(unit)}]" if unit not in ("", "1") else words


def normal_scores(x: Column) -> tuple[Column, Column, float, float]:
    """A normal probability plot: theoretical quantiles, ordered values, and the line through the quartiles.

    At most 500 points, evenly spread over the order, as more cannot be told apart on paper.
    """
    from scipy.stats import norm

    ordered = np.sort(x)
    scores = norm.ppf((np.arange(1, len(x) + 1) - 0.375) / (len(x) + 0.25))
    shown = np.unique(np.linspace(0, len(x) - 1, min(len(x), 500)).round().astype(int))
    low, high = np.quantile(x, [0.25, 0.75])
    slope = (high - low) / (2 * norm.ppf(0.75))
    return scores[shown], ordered[shown], float(slope), float((low + high) / 2)


def histogram(x: Column, bins: int = 40) -> tuple[Column, Column, Column, Column]:
    """Edges and densities of a histogram, and the normal density of the same mean and deviation."""
    densities, edges = np.histogram(x, bins=bins, density=True)
    grid = np.linspace(edges[0], edges[-1], 200)
    sigma = float(x.std()) or 1.0
    normal = np.exp(-0.5 * ((grid - x.mean()) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    return edges, densities, grid, normal
