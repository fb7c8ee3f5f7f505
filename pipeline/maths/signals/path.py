"""Whether two recordings follow the same path."""

import numpy as np

from pipeline.maths.arrays import Array


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
