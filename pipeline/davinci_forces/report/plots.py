"""Plots that several sections show: histograms, normal probability plots and autocorrelations."""

import numpy as np

from davinci_forces.maths.arrays import evenly
from davinci_forces.records import Column, Counts, Whiteness
from davinci_forces.report.content import HBand, Panel, Stems


def normal_scores(x: Column) -> tuple[Column, Column, float, float]:
    """A normal probability plot: theoretical quantiles, ordered values, and the line through the quartiles.

    At most 500 points, evenly spread over the order, as more cannot be told apart on paper.
    """
    from scipy.stats import norm

    ordered = np.sort(x)
    scores = norm.ppf((np.arange(1, len(x) + 1) - 0.375) / (len(x) + 0.25))
    shown = evenly(len(x), 500)
    low, high = np.quantile(x, [0.25, 0.75])
    slope = (high - low) / (2 * norm.ppf(0.75))
    return scores[shown], ordered[shown], float(slope), float((low + high) / 2)


def histogram(x: Column, bins: int = 40) -> tuple[Column, Column, Column, Column]:
    """Edges and densities of a histogram, and the normal density of the same mean and standard deviation."""
    densities, edges = np.histogram(x, bins=bins, density=True)
    grid = np.linspace(edges[0], edges[-1], 200)
    sigma = float(x.std()) or 1.0
    normal = np.exp(-0.5 * ((grid - x.mean()) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    return edges, densities, grid, normal


def autocorrelation(w: Whiteness, heading: str, named: bool = True) -> Panel:
    """An autocorrelation with the bands that white noise stays in; `named` in a legend."""
    acf = w.acf[1:]
    names = ("99 % band", "95 % band") if named else ("", "")
    bands = (HBand(-w.band_99, w.band_99, names[0], "sky"), HBand(-w.band, w.band, names[1]))
    marks = (*bands, Stems(w.lag[1:].astype(float), acf, "", "blue"))
    # Small ones are drawn large enough to be told from the band, and always on both sides of zero.
    reach = max(4 * w.band, 0.1)
    low, high = min(-reach, 1.1 * float(acf.min())), max(reach, min(1.1 * float(acf.max()), 1.0))
    return Panel(heading, "lag [samples]", "autocorrelation", marks, y_range=(low, high))


def binned_means(x: Column, y: Column, bins: int = 40) -> tuple[Column, Column, Column]:
    """Middles of equal ranges of x that hold samples, the mean of y in each, and its standard error."""
    edges = np.linspace(x.min(), x.max(), bins + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, bins - 1)
    held = [y[place == i] for i in range(bins)]
    full = [i for i, values in enumerate(held) if len(values)]
    means = np.array([held[i].mean() for i in full])
    stds = np.array([held[i].std() / np.sqrt(len(held[i])) for i in full])
    return (edges[:-1] + edges[1:])[full] / 2, means, stds


def correlation(x: Column, y: Column, lags: Counts) -> Column:
    """The correlation of x(k) with y(k + lag) of periodic signals of one length, at every lag."""
    x, y = x - x.mean(), y - y.mean()
    scale = float(np.linalg.norm(x) * np.linalg.norm(y)) or 1.0
    return np.array([x @ np.roll(y, -int(lag)) for lag in lags]) / scale


def explained_by(x: Column, y: Column, bins: int = 40) -> float:
    """The share of the variance of y that its means over ranges of x explain, less what chance explains.

    The correlation ratio with Wherry's correction, 0 where y does not depend on x, however crookedly.
    """
    place = np.digitize(x, np.linspace(x.min(), x.max(), bins + 1)[1:-1])
    counts = np.bincount(place, minlength=bins)
    means = np.bincount(place, y, bins) / np.maximum(counts, 1)
    left, ranges, spread = float(np.sum((y - means[place]) ** 2)), int((counts > 0).sum()), float(y.var() * len(y))
    if not spread or len(y) <= ranges:
        return 0.0
    return 1.0 - left / spread * (len(y) - 1) / (len(y) - ranges)
