"""Whether two recordings follow the same path."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.arrays import Array

SAME_PATH = 0.95  # likeness above which two recordings follow the same path


def likeness(t: Array, q: Array, period: Array, length: float) -> float:
    """The largest correlation between a position (N,) and a repeated period (K,) of `length` [s], whatever their phase.

    1 for the same path, which may start anywhere in the period; `t` (N,) [s].  Of a recording of a period or more,
    whole periods are compared.
    """
    K, whole = len(period), int((t[-1] - t[0]) / length + 1e-9)
    if whole:
        q, t = q[t - t[0] < whole * length], t[t - t[0] < whole * length]
    bins = np.rint((t - t[0]) / length % 1.0 * K).astype(np.int64) % K
    sums = np.bincount(bins, q - q.mean(), K)
    shape = period - period.mean()
    products = np.fft.irfft(np.conj(np.fft.rfft(shape)) * np.fft.rfft(sums), K)
    size = np.linalg.norm(q - q.mean()) * np.sqrt(len(q) / K) * np.linalg.norm(shape)
    return float(products.max() / size) if size > 0 else 0.0


def most_different(periods: Sequence[tuple[Array, Array, float]], most: int) -> tuple[list[int], float]:
    """Which periods (t (K,) [s], q (K,), length [s]) stand for all, and the least likeness of any to these.

    The first does, and then, as long as they are not `most`, the one that is least like any of them.
    """
    chosen, nearest = [0], np.full(len(periods), -1.0)
    while True:
        _, q, length = periods[chosen[-1]]
        nearest = np.maximum(nearest, [likeness(t, other, q, length) for t, other, _ in periods])
        nearest[chosen] = 1.0
        if len(chosen) == min(most, len(periods)):
            return sorted(chosen), float(nearest.min())
        rest = np.setdiff1d(np.arange(len(periods)), chosen)
        chosen.append(int(rest[np.argmin(nearest[rest])]))
