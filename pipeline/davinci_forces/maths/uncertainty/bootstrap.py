"""Standard errors by resampling, for statistics without a formula.

The block bootstrap draws blocks of samples that are longer than their correlation.  Kuensch, The jackknife and the
bootstrap for general stationary observations, Annals of Statistics 17 (1989).

The jackknife leaves out one uncorrelated unit, a log or a block, at a time:

    s^2 = (n - 1) / n  sum_i (theta_(i) - mean theta_(.))^2

Efron, The jackknife, the bootstrap and other resampling plans (1982), Eq (3.4).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np

from davinci_forces.maths.arrays import Array, Integers

BOOTSTRAP_BLOCKS = 20
DRAWS = 200

Block = TypeVar("Block")


def blocks(N: int, count: int = BOOTSTRAP_BLOCKS) -> list[slice]:
    """Split N samples into `count` blocks of about equal length; fewer where there are fewer samples."""
    edges = np.linspace(0, N, min(count, max(N, 1)) + 1).round().astype(int).tolist()
    return [slice(start, stop) for start, stop in pairwise(edges) if stop > start]


def standard_error(statistic: Callable[[list[Block]], float], parts: Sequence[Block]) -> float:
    """Bootstrap the standard error of a statistic of blocks, drawn with replacement; NaN for a single block."""
    if len(parts) < 2:
        return float("nan")
    return _spread(np.array([statistic([parts[i] for i in draw]) for draw in _draws(len(parts))]), len(parts))


def error_of_mean(values: Sequence[float] | Array) -> float:
    """Bootstrap the standard error of the mean of numbers (n,), one a block."""
    return _error_of_sums(np.asarray(values), np.ones(len(values), np.int64))


def error_of_pooled_mean(x: Array, function: Callable[[Array], Array] = np.asarray) -> float:
    """Bootstrap the standard error of the mean of samples (N,), in blocks, or of a function of that mean."""
    parts = blocks(len(x))
    return _error_of_sums(np.array([x[part].sum() for part in parts]), _lengths(parts), function)


def _error_of_sums(sums: Array, N: Integers, function: Callable[[Array], Array] = np.asarray) -> float:
    if len(N) < 2:
        return float("nan")
    draws = _draws(len(N))
    return _spread(function(sums[draws].sum(axis=1) / N[draws].sum(axis=1)), len(N))


def error_of_quantile(x: Array, share: float) -> float:
    """Bootstrap the standard error of a quantile of samples (N,), which are sorted once for all draws."""
    parts, drawn = blocks(len(x)), list[float]()
    if len(parts) < 2:
        return float("nan")
    order = np.argsort(x)
    block = np.repeat(np.arange(len(parts)), _lengths(parts))[order]
    for draw in _draws(len(parts)):
        upto = np.cumsum(np.bincount(draw, minlength=len(parts))[block])  # drawn samples up to each sorted one
        place = share * (upto[-1] - 1)  # interpolated between samples, as in `np.quantile`
        below, above = x[order[np.searchsorted(upto, [np.floor(place), np.ceil(place)], side="right")]]
        drawn.append(below + (above - below) * (place % 1.0))
    return _spread(np.array(drawn), len(parts))


def _lengths(parts: Sequence[slice]) -> Integers:
    return np.array([part.stop - part.start for part in parts])


def _draws(n: int) -> Integers:
    """Indices (DRAWS, n) of the n blocks that each draw takes, with replacement."""
    return np.random.default_rng(0).integers(0, n, (DRAWS, n))


def _spread(drawn: Array, n: int) -> float:
    # Drawing n of n blocks understates a variance by the factor (n - 1) / n.
    return float(np.sqrt(n / (n - 1)) * np.std(drawn))


def model_error(slow: Array, noise: float) -> tuple[float, float]:
    """Root mean square of a low-passed residual (N,) beyond the noise in it, and its standard error.

    `noise` is the deviation of the noise that passes the low-pass.  The standard error is that of the blocks' squares.
    """
    squares = slow**2
    spread = error_of_mean([float(squares[part].mean()) for part in blocks(len(slow))])
    return root(float(np.mean(squares)) - noise**2, spread)


def rms(x: Array) -> float:
    """Root mean square of samples (N,); NaN without any."""
    return float(np.sqrt(np.mean(x**2))) if len(x) else float("nan")


def root_mean_square(x: Array, scale: Array | None = None) -> tuple[float, float]:
    """Root mean square of samples (N,), over that of a scale (N,) if there is one, and its standard error.

    The standard error is that of R = mean x^2 / mean y^2, from the mean of x^2 - R y^2 over blocks.
    """
    parts = blocks(len(x))
    N = _lengths(parts)
    sums, scales = (1.0 * N if y is None else np.array([y[part] @ y[part] for part in parts]) for y in (x, scale))
    power = float(scales.sum() / N.sum()) or 1.0
    ratio = float(sums.sum() / N.sum()) / power
    return root(ratio, _error_of_sums(sums - ratio * scales, N) / power)


def root(square: float, std: float) -> tuple[float, float]:
    """Root of a number, 0 of a negative one, and its standard error from that of the number.

    d sqrt(x) = dx / (2 sqrt(x)) diverges at 0: there the root of the standard error is the bound.
    """
    value, bound = float(np.sqrt(max(square, 0.0))), float(np.sqrt(std))
    return value, min(std / (2.0 * value), bound) if value > 0 else bound


def of_left_out(left_out: Array) -> Array:
    """Standard error (p,) from the values (n, p) of a statistic without each of n units; NaN for a single unit."""
    n = len(left_out)
    if n < 2:
        return np.full(left_out.shape[1], np.nan)
    return np.asarray(np.sqrt((n - 1) / n * np.sum((left_out - left_out.mean(0)) ** 2, axis=0)))
