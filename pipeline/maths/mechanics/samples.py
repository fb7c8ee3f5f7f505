"""When there are enough samples for the compiled kernels, and the shape in which these take them."""

import numpy as np

from pipeline.maths.arrays import Array

COMPILE_FROM = 20_000  # samples; fewer are done before the kernels are loaded


def many(q: Array) -> bool:
    """Whether q (..., n) has so many samples that the compiled kernels are worth their start."""
    return bool(q.size >= COMPILE_FROM * q.shape[-1])


def rows(x: Array) -> Array:
    """All samples of (..., n) as one contiguous (N, n), a view where x is contiguous itself."""
    return np.ascontiguousarray(x, float).reshape(-1, x.shape[-1])
