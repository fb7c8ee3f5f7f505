"""Standard errors where there is no formula: by leaving out one of the units, logs or blocks, that do not correlate.

s^2 = (n - 1) / n  sum_i (theta_(i) - mean theta_(.))^2

Efron, The jackknife, the bootstrap and other resampling plans (1982), Eq (3.4).
"""

from collections.abc import Callable

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers


def standard_error(statistic: Callable[[Booleans], Array], units: Integers) -> Array:
    """The standard error (p,) of a statistic (p,) of the samples that are kept (N,), which are of these units (N,).

    NaN for a single unit, of which nothing can be left out.
    """
    numbers = np.unique(units)
    return of_left_out(np.array([statistic(units != n) for n in numbers] if len(numbers) > 1 else [[np.nan]]))


def of_left_out(left_out: Array) -> Array:
    """The same of a statistic (n, p) without each of n units."""
    n = len(left_out)
    if n < 2:
        return np.full(left_out.shape[1], np.nan)
    return np.asarray(np.sqrt((n - 1) / n * np.sum((left_out - left_out.mean(0)) ** 2, axis=0)))
