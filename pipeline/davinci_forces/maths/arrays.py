"""The arrays that everything is made of, named once; docstrings give their shapes and units."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


def evenly(N: int, most: int) -> Integers:
    """The numbers of at most so many of N things, evenly spaced, the first and the last among them."""
    return np.linspace(0, N - 1, min(N, most)).round().astype(np.int64)
