"""Tests for white noise: the autocorrelation and the cumulative periodogram of a signal in one or more pieces.

    r_k = sum x_t x_(t+k) / sum x_t^2,    Q = n (n + 2) sum_k r_k^2 / n_k ~ chi^2                  Ljung and Box (1978)

    C_j = sum_(i <= j) I_i / sum_i I_i,   D = sup |C - j / q| ~ Kolmogorov and Smirnov, q - 1 steps      Bartlett (1955)

n_k is the number of pairs of samples that are k apart within a piece.  The ordinates I of all pieces are sorted by
frequency.  For white noise all ordinates have the same exponential distribution.
"""

from collections.abc import Sequence
from functools import cache
from math import factorial
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array

TWO_SIDED_95, TWO_SIDED_99 = 1.96, 2.576  # standard deviations within which 95 and 99 % of a normal distribution lie
MIN_SAMPLES_WHITENESS = 20  # fewer samples are not tested


class LjungBox(NamedTuple):
    """The statistic, and the probability of a larger one if the signal were white."""

    statistic: float
    probability: float


class Cumulative(NamedTuple):
    """A cumulative periodogram, and its largest distance from a straight line."""

    frequency: Array  # (q,) cycles a sample
    share: Array  # (q,) of the power up to each frequency
    distance: float
    probability: float  # of a larger distance if the signal were white


def centre_pieces(pieces: Sequence[Array]) -> list[Array]:
    """Subtract the common mean from the pieces."""
    mean = sum(float(x.sum()) for x in pieces) / sum(len(x) for x in pieces)
    return [x - mean for x in pieces]


def autocorrelation(pieces: Sequence[Array], lags: int) -> Array:
    """Autocorrelation r (lags + 1,) of centred pieces, over pairs of samples within one piece."""
    from statsmodels.tsa.stattools import acovf

    separator = np.full(lags, np.nan)  # so that no lag reaches from one piece into another
    x = np.concatenate([part for piece in pieces for part in (piece, separator)][:-1])
    products = acovf(x, demean=False, fft=False, missing="conservative", nlag=lags)
    return np.asarray(products / products[0])


def ljung_box(pieces: Sequence[Array], r: Array, lags: int) -> LjungBox:
    """Ljung and Box's test of the first `lags` of an autocorrelation.

    statsmodels assumes the n - k pairs at lag k of a single piece; several pieces have fewer, so r is scaled.
    """
    from statsmodels.tsa.stattools import q_stat

    k, lengths = np.arange(1, lags + 1), np.array([len(x) for x in pieces])
    n, pairs = int(lengths.sum()), np.maximum(lengths[:, None] - k, 0).sum(axis=0)
    paired = pairs > 0
    statistic, probability = q_stat(r[1 : lags + 1][paired] * np.sqrt((n - k[paired]) / pairs[paired]), n)
    return LjungBox(float(statistic[-1]), float(probability[-1]))


def cumulative_periodogram(pieces: Sequence[Array]) -> Cumulative:
    """Cumulative periodogram of centred pieces, at frequencies above 0 and below 1/2 cycle a sample."""
    from scipy.fft import rfft
    from scipy.stats import kstwo

    several = []
    for x in (x for x in pieces if len(x) > 2):
        inner = np.asarray(rfft(x))[1 : (len(x) - 1) // 2 + 1]
        several.append((np.arange(1, len(inner) + 1) / len(x), (inner.real**2 + inner.imag**2) / len(x)))
    frequency, ordinate = several[0]
    if len(several) > 1:
        frequency, ordinate = (np.concatenate(columns) for columns in zip(*several, strict=True))
        order = np.argsort(frequency, kind="stable")
        frequency, ordinate = frequency[order], ordinate[order]
    total = np.cumsum(ordinate)
    share, q = total / total[-1], len(total)
    step = 1.0 / (q - 1)
    above = share[:-1] - step * np.arange(q - 1)  # a step of the straight line's samples lower, and higher
    distance = float(max(above.max(), step - above.min()))
    return Cumulative(frequency, share, distance, float(kstwo.sf(distance, q - 1)))


@cache  # signals of one log have as many, and each takes milliseconds
def distance_of(probability: float, ordinates: int) -> float:
    """Half-width of the band that a cumulative periodogram of white noise exceeds with this probability."""
    from scipy.stats import kstwo

    return float(kstwo.isf(probability, max(ordinates - 1, 1)))


def tests(pieces: Sequence[Array], lags: int) -> tuple[LjungBox, float]:
    """Ljung and Box's test, and the cumulative periodogram's probability; both 0 for too few or constant samples."""
    n = sum(len(x) for x in pieces)
    if n < MIN_SAMPLES_WHITENESS or max(map(len, pieces)) < 5 or all(np.ptp(x) == 0 for x in pieces):
        return LjungBox(0.0, 0.0), 0.0
    centred, tested = centre_pieces(pieces), min(lags, n // 5)
    return ljung_box(centred, autocorrelation(centred, tested), tested), cumulative_periodogram(centred).probability


def cross_correlation(x: Array, u: Array, lags: int) -> Array:
    """The correlation (lags + 1,) of x(t) with u(t - k), k from 0 to lags; 0 where u is constant."""
    from statsmodels.tsa.stattools import ccf

    if np.ptp(u) == 0:
        return np.zeros(lags + 1)
    if len(x) <= BLOCK_SAMPLES:
        return np.asarray(ccf(x, u, adjusted=False, nlags=lags + 1))
    x, u, N = x - x.mean(), u - u.mean(), len(x)  # a few lags of a long series, without its Fourier transform
    return np.array([x[k:] @ u[: N - k] for k in range(lags + 1)]) / np.sqrt((x @ x) * (u @ u))


def shape(x: Array) -> tuple[float, float, float]:
    """Skewness, excess kurtosis, and the probability of a larger Jarque-Bera statistic if x (N,) were normal."""
    level = x - x.mean()
    variance = level @ level / len(x)
    squares = level**2
    kurtosis = float(squares @ squares / len(x) / variance**2) - 3.0
    skewness = float(squares @ level / len(x) / variance**1.5)
    return skewness, kurtosis, float(np.exp(-len(x) / 12.0 * (skewness**2 + kurtosis**2 / 4.0)))


def acf1_std(r: float, N: int) -> float:
    """Standard error of the first autocorrelation r of N samples, sqrt((1 - r^2) / N).  (Bartlett, 1946)"""
    return float(np.sqrt(max(1.0 - r**2, 0.0) / max(N, 1)))


def moment_std(order: int, r: float, N: int) -> float:
    """Standard error of the skewness (order 3) or kurtosis (4) of N normal samples with autocorrelations r^|k|.

    sqrt(order! sum_k r^(order |k|) / N)                                                       (Lomnicki, 1961)
    """
    power = min(abs(r), 1.0 - 1.0 / max(N, 2)) ** order * np.sign(r) ** order
    return float(np.sqrt(factorial(order) * (1.0 + power) / (1.0 - power) / max(N, 1)))


def mean_square_band(N: int) -> tuple[float, float]:
    """95 % interval of the mean square of N samples of white noise of variance 1: chi^2(N) / N."""
    from scipy.special import chdtri

    return float(chdtri(N, 0.975) / N), float(chdtri(N, 0.025) / N)
