"""Finding the period of a recording from the recording itself."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.maths.signals.harmonics import derivative, evaluate, project

AS_GOOD = 2.0  # times the smallest difference: a lag this good is a period, too
DIP = 0.1  # a lag is a period when the normalised difference falls below this; the value of de Cheveigne and Kawahara


class Period(NamedTuple):
    """A period and its standard error [s]."""

    length: float
    std: float


def difference(signals: Sequence[Array]) -> Array:
    """Mean squared difference between a signal and itself `lag` samples later, over twice its variance.

    `signals` are (N,) each, weighted alike; returns (N // 2 + 1,) from lag 0: 0 where they repeat, about 1 where they
    are unrelated.
    """
    N = len(signals[0])
    lags = np.arange(N // 2 + 1)
    total = np.zeros(len(lags))
    for signal in signals:
        x = (signal - signal.mean()) / signal.std()
        spectrum = np.fft.rfft(x, 2 * N)
        products = np.fft.irfft(np.abs(spectrum) ** 2, 2 * N)[: len(lags)]
        energy = np.concatenate([[0.0], np.cumsum(x * x)])
        total += np.maximum(energy[N] - energy[lags] + energy[N - lags] - 2 * products, 0.0) / (N - lags)
    return total / (2 * len(signals))


def guess(signals: Sequence[Array]) -> float | None:
    """The shortest lag after which all signals repeat, in samples, or None where they do not.

    The first dip of the cumulative mean normalised difference says whether they do.  It may be a part of a period after
    which a signal nearly repeats, so the shortest lag is taken that is about as good as the best; then it is sharpened
    on its multiples, where the same error of the period is a larger difference.  (A. de Cheveigne and H. Kawahara,
    YIN, 2002)
    """
    d = difference(signals)
    lags = np.arange(1, len(d))
    normalised = np.concatenate([[1.0], d[1:] * lags / np.maximum(np.cumsum(d[1:]), 1e-300)])
    below = np.flatnonzero(normalised < DIP)
    if not len(below):
        return None
    first = int(below[0])
    good = d <= AS_GOOD * d[first:].min() + 1e-12
    good[:first] = False
    start = int(np.flatnonzero(good)[0])
    stop = start + int(np.argmin(good[start:])) if not good[start:].all() else len(d)
    lag = start + int(np.argmin(d[start:stop]))
    if lag == len(d) - 1 and d[lag] < d[lag - 1]:
        return None  # still falling where the record ends: half of it holds less than one period
    return _sharpened(d, _vertex(d, lag))


def _sharpened(d: Array, period: float) -> float:
    multiple = 1
    while 2 * multiple * period + 2 < len(d):
        multiple *= 2
        centre, reach = round(multiple * period), max(2, round(0.02 * period))
        low, high = max(centre - reach, 1), min(centre + reach + 1, len(d) - 1)
        period = _vertex(d, low + int(np.argmin(d[low:high]))) / multiple
    return period


def _vertex(d: Array, lag: int) -> float:
    """The lowest point of the parabola through three neighbours."""
    if not 0 < lag < len(d) - 1:
        return float(lag)
    left, middle, right = d[lag - 1 : lag + 2]
    curvature = left - 2 * middle + right
    return float(lag + 0.5 * (left - right) / curvature) if curvature > 0 else float(lag)


def refine(t: Array, signals: Sequence[Array], period: float, harmonics: int, steps: int = 30) -> Period:
    """The period whose harmonics fit the signals best, by Gauss-Newton with the coefficients projected out.

    `t` (N,) [s]; `signals` (N,) each, weighted by what each leaves unexplained; `period` [s] close enough that the
    highest harmonic drifts less than half a turn over the record.  The standard error takes the residuals as
    white, and so is too small where they are not.  (G. Golub and V. Pereyra, variable projection, 1973)
    """
    omega, shifted = 2 * np.pi / period, t - t.mean()
    variance = 0.0
    for _ in range(steps):
        numerator, information = _normal_equation(shifted, signals, omega, harmonics)
        step, variance = numerator / information, 1.0 / information
        omega += step
        if abs(step) < 1e-3 * np.sqrt(variance) or abs(step) < 1e-14 * omega:
            break
    length = 2 * np.pi / omega
    return Period(float(length), float(length / omega * np.sqrt(variance)))


def _normal_equation(t: Array, signals: Sequence[Array], omega: float, harmonics: int) -> tuple[float, float]:
    """Gradient and information of the angular frequency, over all signals."""
    numerator = information = 0.0
    for x in signals:
        c = project(t, x, omega, harmonics)
        residual = x - evaluate(c, t, omega)
        slope = t * evaluate(derivative(c, 1.0), t, omega)
        free = slope - evaluate(project(t, slope, omega, harmonics), t, omega)
        weight = 1.0 / max(residual.var(), 1e-24 * x.var(), 1e-300)
        numerator += weight * float(free @ residual)
        information += weight * float(free @ free)
    return numerator, information
