"""Signals as a mean and a few harmonics: projecting on them, evaluating and differentiating them.

Coefficients are (2 H + 1,): mean, then cosine and sine of harmonics 1 to H, at multiples of omega.
"""

import numpy as np

from pipeline.maths.arrays import Array

BLOCK = 1 << 15  # samples whose basis is held at a time
EVEN = 256  # evenly spaced samples in a block
UNEVEN = 1e-7  # of the time between samples, by which they may be off it


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
    a block of samples at a time keeps the memory bounded.  Evenly sampled blocks differ by a turn of each harmonic
    only: one basis serves all, which takes a tenth of the time.
    """
    if step := even_step(t):
        return _project_evenly(t, x, step, omega, harmonics)
    size = 2 * harmonics + 1
    gram, right = np.zeros((size, size)), np.zeros(size)
    for start in range(0, len(t), BLOCK):
        F = basis(t[start : start + BLOCK], omega, harmonics)
        gram += F.T @ F
        right += F.T @ x[start : start + BLOCK]
    return np.asarray(np.linalg.solve(gram, right), dtype=np.float64)


def evaluate(c: Array, t: Array, omega: float) -> Array:
    """The signal (N,) that the coefficients describe."""
    if step := even_step(t):
        return _evaluate_evenly(c, t, step, omega)
    parts = [basis(t[start : start + BLOCK], omega, len(c) // 2) @ c for start in range(0, max(len(t), 1), BLOCK)]
    return np.concatenate(parts)


def even_step(t: Array) -> float:
    """The time between samples (N,); 0 where it is not the same between all, or they are too few for it to matter."""
    if len(t) < EVEN:
        return 0.0
    step = float(t[-1] - t[0]) / (len(t) - 1)
    return step if are_apart(t, step, UNEVEN) else 0.0


def are_apart(t: Array, step: float, within: float) -> bool:
    """Whether samples (N,) are so far apart, none of them off by more than a share of it from where it is due."""
    due = t[0] + np.arange(BLOCK) * step
    for start in range(0, len(t), BLOCK):
        block = t[start : start + BLOCK]
        late = block - due[: len(block)]
        if max(late.max() - start * step, start * step - late.min()) > within * step:
            return False
    return True


def _project_evenly(t: Array, x: Array, step: float, omega: float, harmonics: int) -> Array:
    """The coefficients of evenly sampled x (N,)."""
    whole = len(t) // EVEN * EVEN
    starts = basis(t[:whole:EVEN], omega, harmonics)
    within = x[:whole].reshape(-1, EVEN) @ _one_block(step, omega, harmonics)
    right = _turned(starts, within).sum(axis=0) + x[whole:] @ basis(t[whole:], omega, harmonics)
    return np.asarray(np.linalg.solve(_gram(t, step, omega, harmonics), right), dtype=np.float64)


def _evaluate_evenly(c: Array, t: Array, step: float, omega: float) -> Array:
    """The signal (N,) that the coefficients describe at evenly spaced times."""
    whole, harmonics = len(t) // EVEN * EVEN, len(c) // 2
    signal = np.empty(len(t))
    turned = _turned(basis(-t[:whole:EVEN], omega, harmonics), c)
    np.matmul(turned, _one_block(step, omega, harmonics).T, out=signal[:whole].reshape(-1, EVEN))
    signal[whole:] = basis(t[whole:], omega, harmonics) @ c
    return signal


def _one_block(step: float, omega: float, harmonics: int) -> Array:
    """The basis (EVEN, 2 H + 1) of a block of evenly spaced samples that starts at 0."""
    return basis(np.arange(EVEN, dtype=np.float64) * step, omega, harmonics)


def _turned(starts: Array, parts: Array) -> Array:
    """Cosine and sine parts (B or 1, 2 H + 1) of blocks, each turned on to where its block starts.

    `starts` (B, 2 H + 1) is the basis at the blocks' first samples.
    """
    turned = np.empty(starts.shape)
    turned[:, 0] = parts[..., 0]
    c, s = starts[:, 1::2], starts[:, 2::2]
    p, q = parts[..., 1::2], parts[..., 2::2]
    turned[:, 1::2], turned[:, 2::2] = c * p - s * q, s * p + c * q
    return turned


def _gram(t: Array, step: float, omega: float, harmonics: int) -> Array:
    """The products (2 H + 1, 2 H + 1) of the basis with itself, summed over evenly spaced times (N,).

    cos jx cos kx = (cos (j - k)x + cos (j + k)x) / 2, and so on: sums of twice as many harmonics tell them all.
    """
    whole = len(t) // EVEN * EVEN
    within = _one_block(step, omega, 2 * harmonics).sum(axis=0)
    sums = _turned(basis(t[:whole:EVEN], omega, 2 * harmonics), within).sum(axis=0)
    sums += basis(t[whole:], omega, 2 * harmonics).sum(axis=0)
    cosines, sines = np.append(sums[0], sums[1::2]), np.append(0.0, sums[2::2])
    k = np.arange(harmonics + 1)
    ahead, behind = k[:, None] + k, k[:, None] - k
    sine_behind = np.sign(behind) * sines[np.abs(behind)]
    gram = np.empty((2 * harmonics + 1, 2 * harmonics + 1))
    of_cosine, of_sine = np.append(0, k[1:] * 2 - 1), k[1:] * 2
    gram[np.ix_(of_cosine, of_cosine)] = (cosines[np.abs(behind)] + cosines[ahead]) / 2.0
    gram[np.ix_(of_sine, of_sine)] = (cosines[np.abs(behind)] - cosines[ahead])[1:, 1:] / 2.0
    gram[np.ix_(of_sine, of_cosine)] = (sines[ahead] + sine_behind)[1:] / 2.0
    gram[np.ix_(of_cosine, of_sine)] = gram[np.ix_(of_sine, of_cosine)].T
    return gram


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
