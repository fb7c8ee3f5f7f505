"""Whether numbers with standard errors, one a day, are one number: a trend, a scatter, one that stands out.

Weights are 1 / s^2.  Where values scatter about a line by more than their errors, the error of its slope is widened by
the Birge ratio sqrt(chi^2 / (n - 2)), so that one odd value makes no trend.  Of many tests together, Holm's order keeps
the chance of any false alarm at the stated one (Scandinavian Journal of Statistics 6 (1979) 65-70).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, stdtr

from davinci_forces.maths.arrays import Array, Booleans

FEWEST = 3  # values that tell a trend from a step


class Trend(NamedTuple):
    """The slope of a line through values, its standard error, and how likely that slope is by chance."""

    slope: float
    std: float
    p: float


def trend(t: Array, x: Array, std: Array) -> Trend | None:
    """The weighted line through values (n,) at times (n,); None where there are fewer than three times.

    That of statsmodels' WLS, which would take errors as smaller than stated where values scatter less.
    """
    if len(np.unique(t)) < FEWEST:
        return None
    w, late = std**-2, t - np.average(t, weights=std**-2)
    squares = float(np.sum(w * late**2))
    slope = float(np.sum(w * late * x) / squares)
    left = x - np.average(x, weights=w) - slope * late
    birge = max(float(np.sum(w * left**2)) / (len(x) - 2), 1.0)
    error = float(np.sqrt(birge / squares))
    return Trend(slope, error, two_sided(slope / error, len(x) - 2))


def scatter(x: Array, std: Array) -> float:
    """How likely values (n,) with errors (n,) scatter as they do about one mean, by chance: that of chi^2."""
    w = std**-2
    return float(chdtrc(len(x) - 1, np.sum(w * (x - np.average(x, weights=w)) ** 2))) if len(x) > 1 else 1.0


def stands_out(x: Array, std: Array) -> Array:
    """How likely it is by chance that each value (n,) is as far as it is from the mean of the others (n,).

    The others' mean is as uncertain as they scatter; 1 where there are fewer than three of them.
    """
    p = np.ones(len(x))
    for i in range(len(x)):
        rest, s = np.delete(x, i), np.delete(std, i)
        if len(rest) < FEWEST:
            continue
        w = s**-2
        mean = float(np.average(rest, weights=w))
        birge = max(float(np.sum(w * (rest - mean) ** 2)) / (len(rest) - 1), 1.0)
        spread = float(np.sqrt(birge * (std[i] ** 2 + 1.0 / w.sum())))
        p[i] = two_sided((x[i] - mean) / spread, len(rest) - 1)
    return p


def two_sided(z: float, freedom: int) -> float:
    """The probability of Student's t of so many degrees of freedom beyond +-z."""
    return float(2.0 * stdtr(freedom, -abs(z)))


def holm(p: Sequence[float], chance: float) -> Booleans:
    """Which of many tests tell, so that the chance that any of them tells falsely is at most this."""
    from statsmodels.stats.multitest import multipletests

    return np.asarray(multipletests(p, chance, method="holm")[0])
