"""Where one push ends and the next begins, of a log that does not count them."""

from itertools import pairwise

import numpy as np

from davinci_forces.maths.arrays import Array, Integers

RISES = 0.15  # of the range of what swings: a peak that stands out by less is none


def between_troughs(x: Array, rises: float = RISES) -> list[slice]:
    """Each swing of a signal (N,) up and down again, from the lowest sample before its peak to the lowest after it.

    A peak is one that stands out by at least `rises` of the signal's range, but for the extreme 1 % of its samples; one
    at an end of the signal counts.
    """
    from scipy.signal import find_peaks

    low, high = np.quantile(x, [0.01, 0.99])
    if not high > low:
        return [slice(0, len(x))]
    padded = np.concatenate([[x.min()], x, [x.min()]])
    peaks = find_peaks(padded, prominence=rises * (high - low))[0] - 1
    troughs = [a + int(np.argmin(x[a : b + 1])) for a, b in pairwise(peaks)]
    return [slice(a, b) for a, b in pairwise([0, *troughs, len(x)]) if b > a]


def runs(numbers: Integers) -> list[slice]:
    """The runs of samples of one number (N,), in order."""
    edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)]
    return [slice(a, b) for a, b in pairwise(edges) if b > a]
