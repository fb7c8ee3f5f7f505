"""Types of arrays; docstrings give their shapes and units."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


def evenly(N: int, most: int) -> Integers:
    """Indices of at most `most` of N samples, evenly spaced, including the first and the last."""
    return np.linspace(0, N - 1, min(N, most)).round().astype(np.int64)
