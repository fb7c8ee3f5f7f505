"""Trajectories as finite Fourier series: their motion, their exact ranges, and how well they excite a joint.

The coefficients of a series are also written as one vector x = (a0, a1, b1, a2, b2, ...), in which position, velocity
and acceleration are linear.  Section 6.3
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import Term

Range = tuple[float, float]
SAMPLES = 300  # K, of one period without its end point: what reproduces Table 6.1


@dataclass(frozen=True)
class Fourier:
    """A periodic trajectory of N_f harmonics; `a` and `b` are amplitudes of velocity.  (6.16)"""

    a0: float
    a: tuple[float, ...]
    b: tuple[float, ...]
    period: float  # T_f [s]

    @classmethod
    def of(cls, x: Array, period: float) -> "Fourier":
        """The series of a vector of coefficients."""
        return cls(float(x[0]), tuple(x[1::2].tolist()), tuple(x[2::2].tolist()), period)

    @property
    def x(self) -> Array:
        """The vector of coefficients (1 + 2 N_f,)."""
        return np.array([self.a0, *(c for pair in zip(self.a, self.b, strict=True) for c in pair)], dtype=np.float64)


def basis(period: float, harmonics: int, t: Array) -> tuple[Array, Array, Array]:
    """Matrices (K, 1 + 2 N_f) that give position, velocity and acceleration at t (K,) [s] from x.  (6.16)-(6.18)"""
    w = np.arange(1.0, harmonics + 1) * (2 * np.pi / period)
    sin, cos = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    return _columns(1.0, sin / w, -cos / w), _columns(0.0, cos, sin), _columns(0.0, -w * sin, w * cos)


def motion(series: Fourier, t: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (K,) at the times t (K,) [s].  (6.16), (6.17), (6.18)"""
    q, dq, ddq = basis(series.period, len(series.a), t)
    return q @ series.x, dq @ series.x, ddq @ series.x


def instants(period: float, samples: int = SAMPLES) -> Array:
    """The times (K,) [s] at which one period is sampled; its end, which is its start, is left out."""
    return np.arange(samples, dtype=np.float64) * (period / samples)


def turning_points(series: Fourier) -> tuple[Array, Array, Array]:
    """The times [s] within a period at which position, velocity and acceleration may be extreme: 2 N_f + 1 of each.

    The derivative of a trigonometric polynomial is, times z^N with z = exp(i omega t), a polynomial in z whose roots
    on the unit circle are the extrema.  The angles of *all* roots are given, so that a double root which rounding
    has pushed off the circle is not lost; the others do no harm, since the series passes through them as well.
    """
    k = np.arange(1, len(series.a) + 1)
    velocity = np.array(series.a) - 1j * np.array(series.b)  # a_k cos + b_k sin = Re(velocity_k z^k)
    times = []
    for derivative in (velocity, 1j * k * velocity, -(k**2) * velocity):
        size = np.abs(derivative)
        derivative = np.where(size > 1e-14 * size.max(), derivative, 0.0)  # what rounding hides anyway spoils the roots
        roots = np.roots(np.concatenate([derivative[::-1], [0.0], derivative.conj()]))
        angles = np.concatenate([[0.0], np.angle(roots) % (2 * np.pi)])
        times.append(angles * (series.period / (2 * np.pi)))
    return times[0], times[1], times[2]


def ranges(series: Fourier) -> tuple[Range, Range, Range]:
    """The lowest and highest position, velocity and acceleration over all time, not over samples."""
    values = [motion(series, t)[i] for i, t in enumerate(turning_points(series))]
    q, dq, ddq = ((float(v.min()), float(v.max())) for v in values)
    return q, dq, ddq


def observation(terms: Sequence[Term], series: Fourier, samples: int = SAMPLES) -> Array:
    """F (K, p): the regressor at K instants of one period.  (6.19)"""
    return regressor(terms, *motion(series, instants(series.period, samples)))


def _columns(constant: float, sines: Array, cosines: Array) -> Array:
    pairs = np.stack([sines, cosines], axis=2).reshape(len(sines), -1)
    return np.column_stack([np.full(len(sines), constant), pairs])
