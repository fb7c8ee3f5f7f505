"""Test whether values with standard errors, one a day, are equal: for a trend, a scatter, an outlier.

Weights are 1 / s^2.  If values scatter about a line by more than their errors, the Birge ratio sqrt(chi^2 / (n - 2))
multiplies the error of its slope: one outlier makes no trend.  Holm's method keeps the probability of any
false alarm in many tests at the stated level (Scandinavian Journal of Statistics 6 (1979) 65-70).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, stdtr, stdtrit

from davinci_forces.maths.arrays import Array, Booleans

MIN_VALUES_TREND = 3  # with fewer values, a trend cannot be distinguished from a step


class Trend(NamedTuple):
    """The slope of a line through values, its standard error, and the probability of a larger slope by chance."""

    slope: float
    std: float
    p: float


def trend(t: Array, x: Array, std: Array) -> Trend | None:
    """Fit a weighted line to values (n,) at times (n,); None with fewer than three different times.

    The line is that of statsmodels' WLS, but the errors of WLS are below the stated ones if values scatter less.
    """
    if len(np.unique(t)) < MIN_VALUES_TREND:
        return None
    w, centred = std**-2, t - np.average(t, weights=std**-2)
    squares = float(np.sum(w * centred**2))
    slope = float(np.sum(w * centred * x) / squares)
    residual = x - np.average(x, weights=w) - slope * centred
    birge = max(float(np.sum(w * residual**2)) / (len(x) - 2), 1.0)
    error = float(np.sqrt(birge / squares))
    return Trend(slope, error, two_sided(slope / error, len(x) - 2))


def scatter(x: Array, std: Array) -> float:
    """Probability that values (n,) with errors (n,) scatter more about one mean by chance, by chi^2."""
    w = std**-2
    return float(chdtrc(len(x) - 1, np.sum(w * (x - np.average(x, weights=w)) ** 2))) if len(x) > 1 else 1.0


def outlier_probabilities(x: Array, std: Array) -> Array:
    """Probability (n,) that each value is further from the mean of the others by chance.

    The scatter of the others widens the error of their mean.  With fewer than three others the probability is 1.
    """
    p = np.ones(len(x))
    for i in range(len(x)):
        others, others_std = np.delete(x, i), np.delete(std, i)
        if len(others) < MIN_VALUES_TREND:
            continue
        mean, spread = _mean_and_spread(others, others_std, std[i])
        p[i] = two_sided((x[i] - mean) / spread, len(others) - 1)
    return p


def control_limits(x: Array, std: Array, inside: float) -> tuple[float, Array]:
    """Weighted mean of values (n,), and distance (n,) that a share `inside` of further values in control keeps from it.

    The distance, at each error, is Student's quantile with n - 1 degrees of freedom times the standard deviation of the
    difference; errors are widened as the values scatter.  Shewhart's chart has equal errors, and n without end.
    """
    mean, spread = _mean_and_spread(x, std, std)
    return mean, stdtrit(len(x) - 1, 0.5 + 0.5 * inside) * spread


def _mean_and_spread(x: Array, std: Array, further: Array) -> tuple[float, Array]:
    """Weighted mean (n,), and deviation from it of values with errors `further`, all widened as the values scatter."""
    w = std**-2
    mean = float(np.average(x, weights=w))
    birge = max(float(np.sum(w * (x - mean) ** 2)) / (len(x) - 1), 1.0)
    return mean, np.sqrt(birge * (further**2 + 1.0 / w.sum()))


def two_sided(z: float, freedom: int) -> float:
    """Probability of Student's t, with these degrees of freedom, beyond +-z."""
    return float(2.0 * stdtr(freedom, -abs(z)))


def holm(p: Sequence[float], chance: float) -> Booleans:
    """Which of many tests are significant, so that the probability of any false alarm is at most `chance`.

    The smallest p is compared with chance / n, the next one with chance / (n - 1), as long as all before are smaller.
    """
    # `multipletests` of statsmodels collects garbage at every call, which takes longer than all else of a page.
    order, n = np.argsort(p, kind="stable"), len(p)
    significant = np.empty(n, np.bool_)
    significant[order] = np.logical_and.accumulate(np.asarray(p)[order] <= chance / np.arange(n, 0, -1))
    return significant
