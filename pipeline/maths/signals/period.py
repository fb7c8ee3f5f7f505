"""Finding the period of a recording from the recording itself."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.maths.signals.harmonics import derivative, evaluate, project
from pipeline.maths.signals.repetition import repetition

LOST = 2.0  # lines of the spectrum that an interval of two standard errors has to allow for; found by simulation


class Period(NamedTuple):
    """A period and its standard error [s]."""

    length: float
    std: float


def guess(signals: Sequence[Array]) -> float | None:
    """The shortest lag after which all signals repeat, in samples, or None where they do not."""
    found = repetition(signals)
    return None if found is None else found.lag


def refine(t: Array, signals: Sequence[Array], period: float, harmonics: int, steps: int = 30) -> Period:
    """The period whose harmonics fit the signals best, by Gauss-Newton with the coefficients projected out.

    `t` (N,) [s]; `signals` (N,) each, weighted by what each leaves unexplained; `period` [s] close enough that the
    highest harmonic drifts less than half a turn over the record.  The standard error allows for residuals that are
    correlated, from sample to sample and from signal to signal.  (G. Golub and V. Pereyra, variable projection, 1973)
    """
    omega, shifted = 2 * np.pi / period, t - t.mean()
    for _ in range(steps):
        normal = NormalEquation.at(shifted, signals, omega, harmonics)
        step = normal.gradient / normal.information
        omega += step
        if abs(step) < 1e-3 / np.sqrt(normal.information) or abs(step) < 1e-14 * omega:
            break
    length = 2 * np.pi / omega
    return Period(float(length), float(length / omega * np.sqrt(normal.variance)))


class NormalEquation(NamedTuple):
    """Gradient and information of the angular frequency, over all signals, and the variance of the solution."""

    gradient: float
    information: float
    kept: Callable[[], Array]  # (N // 2 + 1,) share of white noise that fitting the harmonics leaves at each line
    parts: list[tuple[float, Array, Array]]  # of each signal its weight, slope (N,) and residual (N,)

    @classmethod
    def at(cls, t: Array, signals: Sequence[Array], omega: float, harmonics: int) -> "NormalEquation":
        """Linearised at an angular frequency; `t` (N,) is centred, `signals` (N,) each."""
        gradient, information, parts = 0.0, 0.0, []
        for x in signals:
            c = project(t, x, omega, harmonics)
            residual = x - evaluate(c, t, omega)
            slope = t * evaluate(derivative(c, 1.0), t, omega)
            free = slope - evaluate(project(t, slope, omega, harmonics), t, omega)
            weight = 1.0 / max(residual.var(), 1e-24 * x.var(), 1e-300)
            gradient += weight * float(free @ residual)
            information += weight * float(free @ free)
            parts.append((weight, free, residual))
        return cls(gradient, information, partial(_kept, t, omega, harmonics), parts)

    @property
    def variance(self) -> float:
        """Variance of the angular frequency, with the spectrum of the residuals taken from themselves.

        The slope lies in narrow bands beside the harmonics, so few lines say how large the residuals are there.
        """
        spectra, weights = np.zeros(1, complex), np.zeros(1)
        for weight, free, residual in self.parts:
            spectrum = np.fft.rfft(free)
            spectra = spectra + weight * np.conj(spectrum) * np.fft.rfft(residual)
            weights = weights + weight * np.abs(spectrum) ** 2
        weights = weights / weights.sum()
        lines = 1.0 / float(weights @ weights)
        kept = float(weights @ self.kept()) - 1.0 / (2.0 * lines)  # the slope was fitted, too
        # Twice the sum over the half spectrum is that over the whole.
        power = 2.0 * float(np.sum(np.abs(spectra) ** 2)) / (2 * len(spectra) - 2) ** 2
        return float(power / self.information**2 / kept * (1 + LOST / lines))


def _kept(t: Array, omega: float, harmonics: int) -> Array:
    """The share of white noise (N // 2 + 1,) that fitting the mean and the harmonics leaves at each line of a spectrum.

    A harmonic takes what the window of the recording lets through to the lines around it: Dirichlet's kernel.
    """
    N = len(t)
    apart = (t[-1] - t[0]) / (N - 1) * N * omega / (2 * np.pi)  # lines of the spectrum between two harmonics
    lines = np.arange(N // 2 + 1)
    kept = np.ones(len(lines))
    for k in range(-harmonics, harmonics + 1):
        away = np.pi * (lines - k * apart)
        sine = np.sin(away / N)
        near = np.abs(sine) > 1e-9
        kept -= np.where(near, np.sin(away) / (N * np.where(near, sine, 1.0)), 1.0) ** 2
    return np.maximum(kept, 0.0)
