"""Signals as a mean and a few harmonics: projection, evaluation and differentiation.

Coefficients are (2 H + 1,): mean, then cosine and sine of harmonics 1 to H, at multiples of omega.
"""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array

MAX_BASIS_SAMPLES = 1 << 15  # samples whose basis is in memory at a time
EVEN = 256  # samples in a block of evenly spaced ones
MIN_SHARE = 0.01  # of the largest harmonic; a motion has those above it
SIGNIFICANT = 5.0  # times the median amplitude of noise: white noise exceeds it once in 10^7 harmonics
UNEVEN = 1e-7  # share of the time between samples: largest deviation of an even clock


def basis(t: Array, omega: float, harmonics: int) -> Array:
    """The mean and the harmonics at these times, (N, 2 H + 1).  (6.16)"""
    F = np.empty((2 * harmonics + 1, len(t)))  # a harmonic's samples are adjacent in memory, which halves the time
    F[0] = 1.0
    # A power of a rotation costs one product; a cosine and a sine cost twenty times as much.
    turn = np.exp(1j * omega * t)
    turned = np.ones_like(turn)
    for k in range(1, harmonics + 1):
        turned *= turn
        F[2 * k - 1], F[2 * k] = turned.real, turned.imag
    return F.T


class Harmonics:
    """The mean and the first harmonics of omega at times (N,), computed once for all signals.

    Evenly sampled blocks differ only by a rotation of each harmonic, so one basis serves all in a tenth of the time.
    Samples after the last even block, and all samples of an uneven clock, are processed in blocks to limit the memory.
    """

    def __init__(self, t: Array, omega: float, harmonics: int) -> None:
        self.omega, self.harmonics, self._size = omega, harmonics, len(t)
        step = even_step(t)
        self._even = len(t) // EVEN * EVEN if step else 0  # samples in blocks that differ only by a rotation
        self._starts, self._within = t[: self._even : EVEN].copy(), np.arange(EVEN, dtype=np.float64) * step
        self._rest = t[self._even :].copy() if step else t  # a copy, because a view would keep all times in memory

    def project(self, x: Array) -> Array:
        """Fit the coefficients to samples (N,) by least squares; over whole periods they are well conditioned."""
        return np.asarray(np.linalg.solve(self._gram, self._products(x)), dtype=np.float64)

    def evaluate(self, c: Array) -> Array:
        """The signal (N,) that the coefficients describe."""
        signal, turned = np.empty(self._size), np.empty((len(self._starts), len(c)))
        turned[:, 0] = c[0]
        np.multiply(self._turns.conj(), _pairs(c), out=_pairs(turned))
        np.matmul(turned, self._block.T, out=signal[: self._even].reshape(-1, EVEN))
        for part, F in self._blocks(self.harmonics):
            signal[part] = F @ c
        return signal

    def fit(self, x: Array) -> tuple[Array, Array]:
        """Fit the coefficients to samples (N,); return them and the residuals (N,)."""
        c = self.project(x)
        signal = self.evaluate(c)
        return c, np.subtract(x, signal, out=signal)

    @cached_property
    def _block(self) -> Array:
        """The basis (EVEN, 2 H + 1) of a block of evenly spaced samples that starts at 0."""
        return basis(self._within, self.omega, self.harmonics)

    @cached_property
    def _turns(self) -> NDArray[np.complex128]:
        """Rotation (B, H) of each harmonic at the start of each of B blocks."""
        return _pairs(np.ascontiguousarray(basis(self._starts, self.omega, self.harmonics)))

    def _products(self, x: Array) -> Array:
        """The products (2 H + 1,) of the basis with samples (N,)."""
        within = x[: self._even].reshape(-1, EVEN) @ self._block
        products = np.empty(2 * self.harmonics + 1)
        products[0] = within[:, 0].sum()
        _pairs(products)[:] = np.einsum("bk,bk->k", self._turns, _pairs(within))
        for part, F in self._blocks(self.harmonics):
            products += x[part] @ F
        return products

    @cached_property
    def _gram(self) -> Array:
        """The products (2 H + 1, 2 H + 1) of the basis with itself.

        cos jx cos kx = (cos (j - k)x + cos (j + k)x) / 2, and so on: the sums of 2 H harmonics give all products.
        """
        H = self.harmonics
        sums = self._sums(2 * H)
        cosines, sines = np.append(sums[0], sums[1::2]), np.append(0.0, sums[2::2])
        k = np.arange(H + 1)
        sum_of_orders, difference = k[:, None] + k, k[:, None] - k
        sine_of_difference = np.sign(difference) * sines[np.abs(difference)]
        gram = np.empty((2 * H + 1, 2 * H + 1))
        of_cosine, of_sine = np.append(0, k[1:] * 2 - 1), k[1:] * 2
        gram[np.ix_(of_cosine, of_cosine)] = (cosines[np.abs(difference)] + cosines[sum_of_orders]) / 2.0
        gram[np.ix_(of_sine, of_sine)] = (cosines[np.abs(difference)] - cosines[sum_of_orders])[1:, 1:] / 2.0
        gram[np.ix_(of_sine, of_cosine)] = (sines[sum_of_orders] + sine_of_difference)[1:] / 2.0
        gram[np.ix_(of_cosine, of_sine)] = gram[np.ix_(of_sine, of_cosine)].T
        return gram

    def _sums(self, harmonics: int) -> Array:
        """Sum the basis of `harmonics` harmonics over all times: (2 H + 1,)."""
        sums: Array = basis(self._starts, self.omega, harmonics).sum(axis=0)
        within = basis(self._within, self.omega, harmonics).sum(axis=0)
        sums[0] *= within[0]
        _pairs(sums)[:] *= _pairs(within)
        for _, F in self._blocks(harmonics):
            sums += F.sum(axis=0)
        return sums

    def _blocks(self, harmonics: int) -> Iterator[tuple[slice, Array]]:
        """Yield blocks of the samples outside the even blocks, each with its basis (n, 2 H + 1)."""
        for start in range(self._even, self._size, MAX_BASIS_SAMPLES):
            part = slice(start, min(start + MAX_BASIS_SAMPLES, self._size))
            yield part, basis(self._rest[start - self._even : part.stop - self._even], self.omega, harmonics)


def _pairs(parts: Array) -> NDArray[np.complex128]:
    """The cosine and sine parts (..., 2 H + 1) of each harmonic as one number (..., H), in the same memory."""
    return parts[..., 1:].view(np.complex128)


def even_step(t: Array) -> float:
    """Time between samples (N,); 0 for an uneven clock, or for fewer samples than a block."""
    if len(t) < EVEN:
        return 0.0
    step = float(t[-1] - t[0]) / (len(t) - 1)
    return step if are_apart(t, step, UNEVEN) else 0.0


def are_apart(t: Array, step: float, within: float) -> bool:
    """Whether times (N,) follow at one `step`; no time deviates by more than a share `within` of the step."""
    due = t[0] + np.arange(MAX_BASIS_SAMPLES) * step
    for start in range(0, len(t), MAX_BASIS_SAMPLES):
        block = t[start : start + MAX_BASIS_SAMPLES]
        late = block - due[: len(block)]
        if max(late.max() - start * step, start * step - late.min()) > within * step:
            return False
    return True


def derivative(c: Array, omega: float) -> Array:
    """The coefficients of the time derivative, exactly.  (6.17), (6.18)"""
    turned = np.zeros_like(c)
    rate = omega * np.arange(1, len(c) // 2 + 1)
    turned[1::2], turned[2::2] = rate * c[2::2], -rate * c[1::2]
    return turned


def amplitudes(x: Array) -> Array:
    """Amplitude of the mean and of each harmonic of one period, (K // 2 + 1,)."""
    spectrum = np.abs(np.fft.rfft(x)) / len(x)
    spectrum[1:] *= 2.0
    return spectrum


def largest_omitted(amplitude: Array, harmonics: int) -> tuple[int, float]:
    """The order of the largest of `amplitude` (mean, 1, 2, ...) that is not kept, over the largest; else (0, 0.0)."""
    omitted, largest = amplitude[harmonics + 1 :], float(amplitude[1:].max(initial=0.0))
    if not len(omitted) or not largest:
        return 0, 0.0
    order = harmonics + 1 + int(omitted.argmax())
    return order, float(amplitude[order]) / largest


def last_above(amplitude: Array) -> int:
    """The order of the last harmonic above `MIN_SHARE` of the largest, and above the noise of `amplitude`; else 0."""
    noise = SIGNIFICANT * float(np.median(amplitude[len(amplitude) // 2 :]))  # the upper half of the spectrum is noise
    orders = np.flatnonzero(amplitude[1:] > max(noise, MIN_SHARE * float(amplitude[1:].max(initial=0.0)))) + 1
    return int(orders[-1]) if len(orders) else 0


def kept_noise(sigma: float, K: int, harmonics: int, omega: float) -> Array:
    """Covariance (3, 3) of x, dx and ddx from white noise in K samples of a period, after the projection on harmonics.

    Each harmonic keeps 2 sigma^2 / K of it, and the mean half as much.  A derivative leads by a quarter of a period.
    """
    rate = omega * np.arange(1, harmonics + 1)
    variance = sigma**2 / K * (1.0 + 2.0 * harmonics)
    of_dx, of_ddx = (2.0 * sigma**2 / K * float((rate**power).sum()) for power in (2, 4))
    return np.array([[variance, 0.0, -of_dx], [0.0, of_dx, 0.0], [-of_dx, 0.0, of_ddx]])
