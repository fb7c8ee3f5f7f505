"""Signals as a mean and a few harmonics: projecting on them, evaluating and differentiating them.

Coefficients are (2 H + 1,): mean, then cosine and sine of harmonics 1 to H, at multiples of omega.
"""

import numpy as np

from pipeline.maths.arrays import Array

BLOCK = 1 << 15  # samples whose basis is held at a time


def basis(t: Array, omega: float, harmonics: int) -> Array:
    """The mean and the harmonics at these times, (N, 2 H + 1).  (6.16)"""
    F = np.empty((2 * harmonics + 1, len(t)))  # a harmonic's samples beside each other, which halves the time
    F[0] = 1.0
    # Powers of one rotation cost a product each, where a cosine and a sine would cost twenty times as much.
    turn = np.exp(1j * omega * t)
    turned = np.ones_like(turn)
    for k in range(1, harmonics + 1):
        turned *= turn
        F[2 * k - 1], F[2 * k] = turned.real, turned.imag
    return F.T


def project(t: Array, x: Array, omega: float, harmonics: int) -> Array:
    """The coefficients closest to the samples (N,) in the least squares sense.

    The harmonics are all but orthogonal over whole periods, so their normal equations are well conditioned, and
    a block of samples at a time keeps the memory bounded.
    """
    size = 2 * harmonics + 1
    gram, right = np.zeros((size, size)), np.zeros(size)
    for start in range(0, len(t), BLOCK):
        F = basis(t[start : start + BLOCK], omega, harmonics)
        gram += F.T @ F
        right += F.T @ x[start : start + BLOCK]
    return np.asarray(np.linalg.solve(gram, right), dtype=np.float64)


def evaluate(c: Array, t: Array, omega: float) -> Array:
    """The signal (N,) that the coefficients describe."""
    parts = [basis(t[start : start + BLOCK], omega, len(c) // 2) @ c for start in range(0, max(len(t), 1), BLOCK)]
    return np.concatenate(parts)


def derivative(c: Array, omega: float) -> Array:
    """The coefficients of the time derivative, exactly.  (6.17), (6.18)"""
    turned = np.zeros_like(c)
    rate = omega * np.arange(1, len(c) // 2 + 1)
    turned[1::2], turned[2::2] = rate * c[2::2], -rate * c[1::2]
    return turned


def differentiate_fft(x: Array, period: float, harmonics: int, order: int) -> Array:
    """Differentiate one period in the frequency domain, keeping its mean and first harmonics only.

    Each kept line of the spectrum is multiplied by (j omega)^order; the others are taken as noise.  `x` is (K,), evenly
    sampled, its last sample not repeating the first; returns (K,).  `order` 0 smooths.  (6.34)
    """
    spectrum = np.fft.rfft(x)
    spectrum[harmonics + 1 :] = 0.0
    omega = 2 * np.pi / period * np.arange(len(spectrum))
    return np.fft.irfft((1j * omega) ** order * spectrum, n=len(x))


def amplitudes(x: Array) -> Array:
    """Amplitude of the mean and of each harmonic of one period, (K // 2 + 1,)."""
    spectrum = np.abs(np.fft.rfft(x)) / len(x)
    spectrum[1:] *= 2.0
    return spectrum


def kept_noise(sigma: float, K: int, harmonics: int, omega: float) -> Array:
    """What the kept harmonics leave of white noise in K samples of a period: covariance (3, 3) of x, dx and ddx.

    Each harmonic keeps 2 sigma^2 / K and the mean half of that; a derivative is a quarter of a turn ahead, so that only
    x and ddx go together.
    """
    rate = omega * np.arange(1, harmonics + 1)
    own = sigma**2 / K * (1.0 + 2.0 * harmonics)
    of_dx, of_ddx = (2.0 * sigma**2 / K * float((rate**order).sum()) for order in (2, 4))
    return np.array([[own, 0.0, -of_dx], [0.0, of_dx, 0.0], [-of_dx, 0.0, of_ddx]])
