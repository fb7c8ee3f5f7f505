"""Bringing two recordings of one path together, whenever each of them began."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

LEAST = 0.8  # of the shorter of two recordings that do not repeat, which has to lie within the other


class Shift(NamedTuple):
    """How much later than one recording another is where it is, and how far apart they then are."""

    samples: float
    apart: Array  # (J,) root mean square of the difference over the standard deviation


def circular(q: Array, other: Array) -> Shift:
    """The shift of a repeated period (K, J) against another of as many samples, which puts them closest together."""
    spread = np.maximum(q.std(axis=0), 1e-300)
    spectra = np.conj(np.fft.rfft(q / spread, axis=0)) * np.fft.rfft(other / spread, axis=0)
    products = np.fft.irfft(spectra.sum(axis=1), len(q))
    best = int(products.argmax())
    samples = best + _vertex(*(float(products[(best + d) % len(q)]) for d in (-1, 0, 1)))
    return Shift(samples, _apart(q, rolled(other, samples), spread))


def rolled(x: Array, samples: float) -> Array:
    """A repeated period (K, ...) so many samples later, between samples on the straight line."""
    whole = int(np.floor(samples))
    share = samples - whole
    return np.asarray((1.0 - share) * np.roll(x, -whole, axis=0) + share * np.roll(x, -whole - 1, axis=0))


def straight(q: Array, other: Array) -> Shift:
    """The shift in whole samples of a recording (N, J) against another (N', J) that puts them closest together.

    They overlap by `LEAST` of the shorter one.
    """
    spread = np.maximum(q.std(axis=0), 1e-300)
    a, b = q / spread, other / spread
    N, M = len(a), len(b)
    size = 1 << (N + M - 1).bit_length()
    products = np.fft.irfft((np.conj(np.fft.rfft(a, size, axis=0)) * np.fft.rfft(b, size, axis=0)).sum(axis=1), size)
    lags = np.arange(-N + 1, M)
    start, stop = np.maximum(0, -lags), np.minimum(N, M - lags)  # of the rows of a that have a partner
    squares_a, squares_b = (np.concatenate([[0.0], np.cumsum((x**2).sum(axis=1))]) for x in (a, b))
    own = squares_a[stop] - squares_a[start]
    its = squares_b[stop + lags] - squares_b[start + lags]
    shared = stop - start
    difference = (own + its - 2.0 * products[lags % size]) / shared
    lag = int(lags[np.where(shared >= LEAST * min(N, M), difference, np.inf).argmin()])
    first, last = max(0, -lag), min(N, M - lag)
    return Shift(float(lag), _apart(q[first:last], other[first + lag : last + lag], spread))


def _apart(q: Array, other: Array, spread: Array) -> Array:
    return np.asarray(np.sqrt(np.mean((q - other) ** 2, axis=0)) / spread)


def _vertex(left: float, middle: float, right: float) -> float:
    """Where the parabola through three neighbours turns, from the middle one."""
    curvature = 2.0 * middle - left - right
    return float(np.clip(0.5 * (right - left) / curvature, -0.5, 0.5)) if curvature > 0 else 0.0
