"""Estimate the period of a recording from the recording itself."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.periods.harmonics import Harmonics, derivative

MAX_STEPS = 30  # of Gauss-Newton
LINES_LOST = 2.0  # spectral lines by which an interval of two standard errors is widened; found by simulation
LINES_BESIDE = 1000  # spectral lines used above the highest harmonic; 3e-4 of the slope's power is beyond them


class Period(NamedTuple):
    """A period and its standard error [s]."""

    length: float
    std: float


def refine(t: Array, signals: Sequence[Array], period: float, harmonics: int) -> float:
    """Fit the period [s] of the signals' harmonics by Gauss-Newton with the coefficients projected out.

    `t` (N,) [s]; `signals` (N,) each, weighted by the inverse of its residual power; `period` [s] is close: the
    highest harmonic drifts less than half a turn over the record.  (G. Golub and V. Pereyra, variable projection, 1973)
    """
    omega, shifted = 2 * np.pi / period, t - t.mean()
    for _ in range(MAX_STEPS):
        gradient, information = 0.0, 0.0
        for weight, slope, residual in _linearised(shifted, signals, omega, harmonics):
            gradient += weight * float(slope @ residual)
            information += weight * float(slope @ slope)
        step = gradient / information
        omega += step
        if abs(step) < 1e-3 / np.sqrt(information) or abs(step) < 1e-14 * omega:
            break
    return float(2 * np.pi / omega)


def standard_error(t: Array, signals: Sequence[Array], period: float, harmonics: int) -> float:
    """Standard error [s] of the fitted period of signals (N,), for residuals of any colour.

    Residuals may be correlated from sample to sample and from signal to signal, so their spectrum is used.  The slope,
    a signal's derivative by frequency, lies in narrow bands around the harmonics: few spectral lines give the error.
    """
    from scipy.fft import prev_fast_len, rfft

    N = prev_fast_len(len(t), real=True)  # samples of the spectrum: slightly fewer, which is faster
    spacing = (t[N - 1] - t[0]) / (N - 1) * N / period  # lines of the spectrum between two harmonics
    lines = np.arange(min(int(harmonics * spacing) + LINES_BESIDE, N // 2 + 1))
    spectra, weights, information = np.zeros(len(lines), complex), np.zeros(len(lines)), 0.0
    for weight, slope, residual in _linearised(t - t.mean(), signals, 2 * np.pi / period, harmonics):
        information += weight * float(slope @ slope)
        of_slope, of_residual = (np.array(rfft(x[:N])[: len(lines)]) for x in (slope, residual))
        spectra += weight * of_slope.conj() * of_residual
        weights += weight * np.abs(of_slope) ** 2
    power = float(np.vdot(spectra, spectra).real) / (N * float(weights.sum()))
    weights /= weights.sum()
    line_share = float(weights @ weights)  # the share of one line if all lines had the same weight
    remaining = 1.0 - float(weights @ _taken(lines, N, spacing, harmonics)) - line_share / 2.0  # the slope is fitted
    variance = power / information / remaining * (1.0 + LINES_LOST * line_share)
    return float(period**2 / (2 * np.pi) * np.sqrt(variance))


def _linearised(
    t: Array, signals: Sequence[Array], omega: float, harmonics: int
) -> Iterator[tuple[float, Array, Array]]:
    """Yield each signal's weight, derivative by omega orthogonal to harmonics, and residual (N,); `t` is centred."""
    harmonic = Harmonics(t, omega, harmonics)
    for x in signals:
        c, residual = harmonic.fit(x)
        _, slope = harmonic.fit(t * harmonic.evaluate(derivative(c, 1.0)))
        yield len(t) / max(float(residual @ residual), 1e-24 * float(x @ x), 1e-300), slope, residual


def _taken(lines: Integers, N: int, spacing: float, harmonics: int) -> Array:
    """Share of white noise that fitting the mean and the harmonics removes from some lines of a spectrum.

    A harmonic affects the lines around it by Dirichlet's kernel of the N samples.
    """
    distances = (lines - k * spacing for k in range(-harmonics, harmonics + 1))
    shares = ((np.sinc(d) / np.sinc(d / N)) ** 2 for d in distances)
    return np.minimum(sum(shares, np.zeros(len(lines))), 1.0)
