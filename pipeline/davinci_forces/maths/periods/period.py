"""Finding the period of a recording from the recording itself."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.periods.harmonics import Harmonics, derivative
from davinci_forces.maths.periods.repetition import repetition

LOST = 2.0  # lines of the spectrum that an interval of two standard errors has to allow for; found by simulation
BESIDE = 1000  # lines of the spectrum above the highest harmonic, beyond which the slope has 3e-4 of its power


class Period(NamedTuple):
    """A period and its standard error [s]."""

    length: float
    std: float


def guess(signals: Sequence[Array]) -> float | None:
    """The shortest lag after which all signals repeat, in samples, or None where they do not."""
    found = repetition(signals)
    return None if found is None else found.lag


def refine(t: Array, signals: Sequence[Array], period: float, harmonics: int, steps: int = 30) -> float:
    """The period [s] whose harmonics fit the signals best, by Gauss-Newton with the coefficients projected out.

    `t` (N,) [s]; `signals` (N,) each, weighted by what each leaves unexplained; `period` [s] close enough that the
    highest harmonic drifts less than half a turn over the record.  (G. Golub and V. Pereyra, variable projection, 1973)
    """
    omega, shifted = 2 * np.pi / period, t - t.mean()
    for _ in range(steps):
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
    """The standard error [s] of the period that fits the signals (N,) best, of residuals whatever their colour.

    They may be correlated from sample to sample and from signal to signal: their spectrum is taken from themselves.
    The slope lies in narrow bands beside the harmonics, so few lines say how large the residuals are there.
    """
    from scipy.fft import prev_fast_len, rfft

    N = prev_fast_len(len(t), real=True)  # samples whose spectrum is taken: few less than there are
    apart = (t[N - 1] - t[0]) / (N - 1) * N / period  # lines of the spectrum between two harmonics
    lines = np.arange(min(int(harmonics * apart) + BESIDE, N // 2 + 1))
    spectra, weights, information = np.zeros(len(lines), complex), np.zeros(len(lines)), 0.0
    for weight, slope, residual in _linearised(t - t.mean(), signals, 2 * np.pi / period, harmonics):
        information += weight * float(slope @ slope)
        of_slope, of_residual = (np.array(rfft(x[:N])[: len(lines)]) for x in (slope, residual))
        spectra += weight * of_slope.conj() * of_residual
        weights += weight * np.abs(of_slope) ** 2
    power = float(np.vdot(spectra, spectra).real) / (N * float(weights.sum()))
    weights /= weights.sum()
    alike = float(weights @ weights)  # the share of one line, were they all of one weight
    kept = 1.0 - float(weights @ _taken(lines, N, apart, harmonics)) - alike / 2.0  # the slope was fitted, too
    variance = power / information / kept * (1.0 + LOST * alike)
    return float(period**2 / (2 * np.pi) * np.sqrt(variance))


def _linearised(
    t: Array, signals: Sequence[Array], omega: float, harmonics: int
) -> Iterator[tuple[float, Array, Array]]:
    """Of each signal its weight, its slope with omega as far as its harmonics cannot follow, and what they leave of it.

    `t` (N,) is centred; `signals`, slopes and residuals are (N,) each.
    """
    fit = Harmonics(t, omega, harmonics)
    for x in signals:
        c, residual = fit.left(x)
        _, slope = fit.left(t * fit.evaluate(derivative(c, 1.0)))
        yield len(t) / max(float(residual @ residual), 1e-24 * float(x @ x), 1e-300), slope, residual


def _taken(lines: Integers, N: int, apart: float, harmonics: int) -> Array:
    """The share of white noise that fitting the mean and the harmonics takes from these lines of a spectrum.

    A harmonic takes what the window of N samples lets through to the lines around it: Dirichlet's kernel.
    """
    away = (lines - k * apart for k in range(-harmonics, harmonics + 1))
    shares = ((np.sinc(d) / np.sinc(d / N)) ** 2 for d in away)
    return np.minimum(sum(shares, np.zeros(len(lines))), 1.0)
