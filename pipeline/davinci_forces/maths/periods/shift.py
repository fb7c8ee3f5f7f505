"""Align two recordings of one path in time."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.periods.repetition import vertex

MIN_OVERLAP = 0.8  # of two recordings that do not repeat: share of the shorter one that must lie within the other
SAME_PATH = 0.95  # likeness above which two recordings follow the same path


def circular(q: Array, reference: Array) -> tuple[float, Array]:
    """Shift in samples of a repeated period (K, J) against another of as many that minimises their difference.

    Returns also what remains of that (J,): its root mean square over the standard deviation.
    """
    spread = np.maximum(q.std(axis=0), 1e-300)
    spectra = np.conj(np.fft.rfft(q / spread, axis=0)) * np.fft.rfft(reference / spread, axis=0)
    products = np.fft.irfft(spectra.sum(axis=1), len(q))
    best = int(products.argmax())
    samples = best + vertex(*(-float(products[(best + d) % len(q)]) for d in (-1, 0, 1)))[0]
    return samples, _apart(q, roll(reference, samples), spread)


def roll(x: Array, samples: float) -> Array:
    """Shift a repeated period (K, ...) by a number of samples, with linear interpolation."""
    whole = int(np.floor(samples))
    share = samples - whole
    return np.asarray((1.0 - share) * np.roll(x, -whole, axis=0) + share * np.roll(x, -whole - 1, axis=0))


def straight(q: Array, reference: Array) -> tuple[float, Array]:
    """The same in whole samples of a recording (N, J) against another (N', J), over the part that both cover."""
    spread = np.maximum(q.std(axis=0), 1e-300)
    a, b = q / spread, reference / spread
    N, M = len(a), len(b)
    size = 1 << (N + M - 1).bit_length()
    products = np.fft.irfft((np.conj(np.fft.rfft(a, size, axis=0)) * np.fft.rfft(b, size, axis=0)).sum(axis=1), size)
    lags = np.arange(-N + 1, M)
    start, stop = np.maximum(0, -lags), np.minimum(N, M - lags)  # of the rows of a that overlap b
    squares_a, squares_b = (np.concatenate([[0.0], np.cumsum((x**2).sum(axis=1))]) for x in (a, b))
    power_a = squares_a[stop] - squares_a[start]
    power_b = squares_b[stop + lags] - squares_b[start + lags]
    shared = stop - start
    difference = (power_a + power_b - 2.0 * products[lags % size]) / shared
    lag = int(lags[np.where(shared >= MIN_OVERLAP * min(N, M), difference, np.inf).argmin()])
    first, last = max(0, -lag), min(N, M - lag)
    return float(lag), _apart(q[first:last], reference[first + lag : last + lag], spread)


def _apart(q: Array, reference: Array, spread: Array) -> Array:
    return np.asarray(np.sqrt(np.mean((q - reference) ** 2, axis=0)) / spread)


def likeness(t: Array, q: Array, period: Array, length: float) -> float:
    """Largest correlation between a position (N,) and a repeated period (K,) of `length` [s] over all phases.

    It is 1 for the same path, from any start; `t` (N,) [s].  Of a period or more, whole periods are compared.
    """
    K, whole = len(period), int((t[-1] - t[0]) / length + 1e-9)
    if whole:
        N = int(np.sum(t - t[0] < whole * length))
        q, t = q[:N], t[:N]
    bins = np.rint((t - t[0]) / length % 1.0 * K).astype(np.int64) % K
    sums = np.bincount(bins, q - q.mean(), K)
    shape = period - period.mean()
    products = np.fft.irfft(np.conj(np.fft.rfft(shape)) * np.fft.rfft(sums), K)
    size = np.linalg.norm(q - q.mean()) * np.sqrt(len(q) / K) * np.linalg.norm(shape)
    return float(products.max() / size) if size > 0 else 0.0


def most_different(periods: Sequence[tuple[Array, Array, float]], most: int) -> tuple[list[int], float]:
    """Choose at most `most` periods (t (K,) [s], q (K,), length [s]), each least like the others; and that likeness."""
    chosen, nearest = [0], np.full(len(periods), -1.0)
    while True:
        _, q, length = periods[chosen[-1]]
        nearest = np.maximum(nearest, [likeness(t, q_i, q, length) for t, q_i, _ in periods])
        nearest[chosen] = 1.0
        if len(chosen) == min(most, len(periods)):
            return sorted(chosen), float(nearest.min())
        candidates = np.setdiff1d(np.arange(len(periods)), chosen)
        chosen.append(int(candidates[np.argmin(nearest[candidates])]))
