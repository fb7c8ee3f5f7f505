"""Trajectories as finite Fourier series: motion, exact ranges, run-in, and criteria of excitation.

The coefficients of a series form one vector x = (a0, a1, b1, a2, b2, ...).  Position, velocity and acceleration are
linear in x.  Section 6.3

A criterion is smaller, the better a regressor F (..., K, p) determines its parameters; it is infinite
without full rank.

The run-in leads from a standstill into the trajectory along the same path, slowly at first:

    q(sigma(t)),    dq sigma',    ddq sigma'^2 + dq sigma'',    sigma' = 10 u^3 - 15 u^4 + 6 u^5,    u = 1 + t / T

over -T <= t <= 0.  sigma' rises from 0 to 1 with sigma'' = sigma''' = 0 at both ends, so position, velocity,
acceleration and jerk are continuous.  Positions and velocities keep every limit that the periodic trajectory
keeps; accelerations keep their limits if T is long enough.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import Term

Range = tuple[float, float]
PERIOD_SAMPLES = 300  # K, of one period without its end point; this number reproduces Table 6.1
# Number of entries of the largest matrix that is factored in one piece: for a larger one, the library starts threads.
# The matrices here are so small that threads make the search slower, up to 20 times on a busy machine.
MAX_QR_ENTRIES = 8000
RUN_IN_INSTANTS = 10_000  # instants of a run-in at which the limits are checked
LIMIT_MARGIN = 1e-5  # margin, as a share of a limit, for peaks between the checked instants


@dataclass(frozen=True)
class Fourier:
    """A periodic trajectory of N_f harmonics; `a` and `b` are amplitudes of velocity.  (6.16)"""

    a0: float
    a: tuple[float, ...]
    b: tuple[float, ...]
    period: float  # T_f [s]

    @classmethod
    def from_coefficients(cls, x: Array, period: float) -> "Fourier":
        """The series with the vector of coefficients x."""
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


def instants(period: float, samples: int = PERIOD_SAMPLES) -> Array:
    """The times (K,) [s] at which one period is sampled, without its end point, which repeats its start."""
    return np.arange(samples, dtype=np.float64) * (period / samples)


def ranges(series: Fourier) -> tuple[Range, Range, Range]:
    """The lowest and highest position, velocity and acceleration at any time, also between samples.

    Multiplied by z^N_f, z = exp(i omega t), the derivative of a trigonometric polynomial is a polynomial in z.  Its
    roots on the unit circle are the extrema.  The angles of *all* roots are tried: rounding may move a double root
    off the circle.  Additional angles do no harm, since a value of the series at any angle lies within its range.
    """
    k = np.arange(1, len(series.a) + 1)
    velocity = np.array(series.a) - 1j * np.array(series.b)  # a_k cos + b_k sin = Re(velocity_k z^k)
    extremes = list[Range]()
    for i, derivative in enumerate((velocity, 1j * k * velocity, -(k**2) * velocity)):
        size = np.abs(derivative)
        # A coefficient that is only rounding error would spoil the roots.
        derivative = np.where(size > 1e-14 * size.max(), derivative, 0.0)
        roots = np.roots(np.concatenate([derivative[::-1], [0.0], derivative.conj()]))
        angles = np.concatenate([[0.0], np.angle(roots) % (2 * np.pi)])
        values = motion(series, angles * (series.period / (2 * np.pi)))[i]
        extremes.append((float(values.min()), float(values.max())))
    return extremes[0], extremes[1], extremes[2]


def observation(terms: Sequence[Term], series: Fourier, samples: int = PERIOD_SAMPLES) -> Array:
    """F (K, p): the regressor at K instants of one period.  (6.19)"""
    return regressor(terms, *motion(series, instants(series.period, samples)))


def _columns(constant: float, of_a: Array, of_b: Array) -> Array:
    pairs = np.stack([of_a, of_b], axis=2).reshape(len(of_a), -1)
    return np.column_stack([np.full(len(of_a), constant), pairs])


def determinant(F: Array) -> Array:
    """-log10 det(F^T F) for each of the leading indices of F, shape (...).  (6.20)"""
    diagonal = np.abs(np.diagonal(qr_factor(F), axis1=-2, axis2=-1))
    return _where_full_rank(F, diagonal.min(-1), diagonal.max(-1), lambda: -2 * np.log10(diagonal).sum(-1))


def condition(F: Array) -> Array:
    """log10 of the condition number for each of the leading indices of F, shape (...)."""
    s: Array = np.asarray(np.linalg.svd(qr_factor(F), compute_uv=False), np.float64)
    return _where_full_rank(F, s[..., -1], s[..., 0], lambda: np.log10(s[..., 0] / s[..., -1]))


def qr_factor(F: Array) -> Array:
    """The factor R (..., p, p) of F = Q R; for many samples, blocks of F are factored, then the factors together."""
    samples, parameters = F.shape[-2:]
    rows = max(2 * parameters, MAX_QR_ENTRIES // parameters)
    if samples <= rows:
        return np.asarray(np.linalg.qr(F, mode="r"))
    blocks = [np.linalg.qr(F[..., i : i + rows, :], mode="r") for i in range(0, samples, rows)]
    return qr_factor(np.concatenate(blocks, axis=-2))


def _where_full_rank(F: Array, smallest: Array, largest: Array, value: Callable[[], Array]) -> Array:
    samples, parameters = F.shape[-2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        full = (samples >= parameters) & (smallest > samples * np.finfo(float).eps * largest)
        return np.where(full, value(), np.inf)


CRITERIA = {"determinant": determinant, "condition": condition}


def determinant_gradient(F: Array) -> tuple[float, Array]:
    """-ln det(F^T F) of F (K, p), and its gradient -2 F (F^T F)^-1 with respect to the entries of F."""
    R = qr_factor(F)
    with np.errstate(divide="ignore"):
        value = -2 * float(np.log(np.abs(np.diagonal(R))).sum())
    inverse = np.linalg.inv(R) if np.isfinite(value) else np.full_like(R, np.inf)
    return value, np.asarray(-2 * (F @ inverse) @ inverse.T)


def condition_gradient(F: Array) -> tuple[float, Array]:
    """The natural logarithm of the condition number of F (K, p), and its gradient with respect to the entries of F."""
    s, V = np.linalg.svd(qr_factor(F))[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        gradients = (np.outer(F @ v, v) / size**2 for v, size in ((V[0], s[0]), (V[-1], s[-1])))
        return float(np.log(s[0] / s[-1])), np.asarray(np.subtract(*gradients))


# Minima are the same for natural logarithms, whose gradients are simpler.
GRADIENTS = {"determinant": determinant_gradient, "condition": condition_gradient}


def expected_std(F: Array, noise: Array) -> Array:
    """Standard errors (p,) of least squares on F (K, p) with white noise of standard deviations `noise` (K,).

    They are the roots of the diagonal of (F^T diag(1 / noise^2) F)^-1, and infinite without full rank.  (6.31)
    """
    R = qr_factor(F / noise[:, None])
    if not np.isfinite(condition(R)):
        return np.full(F.shape[1], np.inf)
    return np.asarray(np.linalg.norm(np.linalg.inv(R), axis=1))


def run_in(series: Fourier, t: Array, duration: float) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (K,) at t (K,) [s] of a run-in, from rest at -duration to full speed at 0."""
    u = 1 + t / duration
    sigma = duration * (u**4 * (2.5 - 3 * u + u**2) - 0.5)
    dsigma = u**3 * (10 - 15 * u + 6 * u**2)
    ddsigma = 30 * (u * (1 - u)) ** 2 / duration
    q, dq, ddq = motion(series, sigma)
    return q, dsigma * dq, dsigma**2 * ddq + ddsigma * dq


def shortest_run_in(
    series: Sequence[Fourier], accelerations: Sequence[Range], durations: Array,
    keeps_limits: Callable[[Array, Array, Array], bool] | None = None,
) -> float | None:  # fmt: skip
    """The first of the ascending `durations` [s] for which all run-ins keep their limits of acceleration, or None.

    If a series itself exceeds the limits, its run-in may reach the accelerations of the series.  `keeps_limits`
    of a motion (K, n) tells whether it keeps limits that couple the joints.
    """
    limits, reached = np.array(accelerations) * (1 - LIMIT_MARGIN), np.array([ranges(s)[2] for s in series])
    low, high = np.minimum(limits[:, 0], reached[:, 0]), np.maximum(limits[:, 1], reached[:, 1])
    for duration in durations.tolist():
        t = np.linspace(-duration, 0.0, RUN_IN_INSTANTS)
        q, dq, ddq = (np.stack(x, axis=-1) for x in zip(*(run_in(s, t, duration) for s in series), strict=True))
        if ((low <= ddq) & (ddq <= high)).all() and (keeps_limits is None or keeps_limits(q, dq, ddq)):
            return float(duration)
    return None
