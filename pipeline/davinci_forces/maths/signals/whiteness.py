"""Whether a signal is white noise: its autocorrelation and its cumulative periodogram, over one or more pieces of it.

    r_k = sum x_t x_(t+k) / sum x_t^2,    Q = n (n + 2) sum_k r_k^2 / n_k ~ chi^2                  Ljung and Box (1978)
    C_j = sum_(i <= j) I_i / sum_i I_i,   D = sup |C - j / q| ~ Kolmogorov and Smirnov, q - 1 steps      Bartlett (1955)

n_k pairs of samples are k apart within a piece; the ordinates I of all pieces are taken in the order of their
frequencies, because of white noise each of them is exponentially distributed with the same mean.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

NORMAL_95, NORMAL_99 = 1.96, 2.576  # deviations that as much of the normal distribution is within
FEWEST = 20  # samples, below which nothing can be said


class LjungBox(NamedTuple):
    """The statistic, and the probability of a larger one if the signal were white."""

    statistic: float
    probability: float


class Cumulative(NamedTuple):
    """A cumulative periodogram, with how far it strays from a straight line."""

    frequency: Array  # (q,) cycles a sample
    share: Array  # (q,) of the power up to each frequency
    distance: float
    probability: float  # of a larger distance if the signal were white


def centred(pieces: Sequence[Array]) -> list[Array]:
    """The pieces less their common mean."""
    mean = sum(float(x.sum()) for x in pieces) / sum(len(x) for x in pieces)
    return [x - mean for x in pieces]


def autocorrelation(pieces: Sequence[Array], lags: int) -> Array:
    """r (lags + 1,) of centred pieces; a pair of samples counts where both are in one piece."""
    from scipy.fft import irfft, next_fast_len, rfft

    apart = np.zeros(lags)  # so that no lag reaches from one piece into another
    x = np.concatenate([part for piece in pieces for part in (piece, apart)])
    length = next_fast_len(len(x), real=True)
    X = rfft(x, length)
    products = irfft(X.real**2 + X.imag**2, length)[: lags + 1]
    return np.asarray(products / products[0])


def ljung_box(pieces: Sequence[Array], r: Array, lags: int) -> LjungBox:
    """The test of the first `lags` of an autocorrelation."""
    from scipy.special import chdtrc

    k, lengths = np.arange(1, lags + 1), np.array([len(x) for x in pieces])
    n, pairs = int(lengths.sum()), np.maximum(lengths[:, None] - k, 0).sum(axis=0)
    told = pairs > 0
    Q = float(n * (n + 2) * np.sum(r[1 : lags + 1][told] ** 2 / pairs[told]))
    return LjungBox(Q, float(chdtrc(int(told.sum()), Q)))


def cumulative_periodogram(pieces: Sequence[Array]) -> Cumulative:
    """Of centred pieces, by the ordinates between frequency 0 and half a cycle a sample, both left out."""
    from scipy.fft import rfft

    several = [_ordinates(np.asarray(rfft(x)), len(x)) for x in pieces if len(x) > 2]
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
    return Cumulative(frequency, share, distance, chance_of(distance, q - 1))


def _ordinates(X: Array, length: int) -> tuple[Array, Array]:
    inner = X[1 : (length - 1) // 2 + 1]
    return np.arange(1, len(inner) + 1) / length, (inner.real**2 + inner.imag**2) / length


def chance_of(distance: float, steps: int) -> float:
    """The probability that uniform samples stray farther from a straight line."""
    from scipy.stats import kstwo

    return float(kstwo.sf(distance, steps))


def distance_of(probability: float, ordinates: int) -> float:
    """Half the width of the band that a cumulative periodogram of white noise leaves with that probability."""
    from scipy.stats import kstwo

    return float(kstwo.isf(probability, max(ordinates - 1, 1)))


def tests(pieces: Sequence[Array], lags: int) -> tuple[LjungBox, float]:
    """Ljung and Box's, and the probability of a cumulative periodogram that strays farther.

    Both probabilities are 0 where nothing can be said.
    """
    n = sum(len(x) for x in pieces)
    if n < FEWEST or max(map(len, pieces)) < 5 or all(np.ptp(x) == 0 for x in pieces):
        return LjungBox(0.0, 0.0), 0.0
    level, tested = centred(pieces), min(lags, n // 5)
    return ljung_box(level, autocorrelation(level, tested), tested), cumulative_periodogram(level).probability


def cross_correlation(x: Array, u: Array, lags: int) -> Array:
    """The correlation (2 lags + 1,) of x(t) with u(t - k), k from -lags to lags: of lags above 0, u comes first."""
    from scipy.fft import irfft, next_fast_len, rfft

    x, u = x - x.mean(), u - u.mean()
    length = next_fast_len(len(x) + lags, real=True)
    products = irfft(rfft(x, length) * np.conj(rfft(u, length)), length)
    scale = float(np.linalg.norm(x) * np.linalg.norm(u)) or 1.0
    return np.asarray(np.concatenate([products[length - lags :], products[: lags + 1]]) / scale)


def shape(x: Array) -> tuple[float, float, float]:
    """Skewness, excess kurtosis, and the probability of a larger Jarque-Bera statistic if x (N,) were normal."""
    from scipy.special import chdtrc

    d = x - x.mean()
    d2 = d * d
    m2, m3, m4 = (float(np.mean(m)) for m in (d2, d2 * d, d2 * d2))
    skewness, kurtosis = m3 / m2**1.5, m4 / m2**2 - 3.0
    return skewness, kurtosis, float(chdtrc(2, len(x) / 6.0 * (skewness**2 + kurtosis**2 / 4.0)))


def mean_square_band(N: int) -> tuple[float, float]:
    """Where the mean square of N samples of white noise of variance 1 is in 95 of 100 cases: chi^2(N) / N."""
    from scipy.special import chdtri

    return float(chdtri(N, 0.975) / N), float(chdtri(N, 0.025) / N)
