"""Signals as a mean and a few harmonics: projecting on them, evaluating and differentiating them.

Coefficients are (2 H + 1,): mean, then cosine and sine of harmonics 1 to H, at multiples of omega.
"""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array

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


class Harmonics:
    """The mean and the first harmonics of omega at times (N,): what depends on these alone serves all signals.

    Evenly sampled blocks differ by a turn of each harmonic only: one basis serves all, which takes a tenth of the time.
    What they leave, and all of an uneven clock, is taken a block at a time, which keeps the memory bounded.
    """

    def __init__(self, t: Array, omega: float, harmonics: int) -> None:
        self.omega, self.harmonics, self._size = omega, harmonics, len(t)
        step = even_step(t)
        self._even = len(t) // EVEN * EVEN if step else 0  # samples in blocks that differ by a turn only
        self._starts, self._within = t[: self._even : EVEN].copy(), np.arange(EVEN, dtype=np.float64) * step
        self._rest = t[self._even :].copy() if step else t  # no view, which would keep all times of a long log

    def project(self, x: Array) -> Array:
        """The coefficients closest to samples (N,) in the least squares sense.

        The harmonics are all but orthogonal over whole periods, so their normal equations are well conditioned.
        """
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

    def left(self, x: Array) -> tuple[Array, Array]:
        """The coefficients closest to samples (N,), and what they leave of them (N,)."""
        c = self.project(x)
        signal = self.evaluate(c)
        return c, np.subtract(x, signal, out=signal)

    @cached_property
    def _block(self) -> Array:
        """The basis (EVEN, 2 H + 1) of a block of evenly spaced samples that starts at 0."""
        return basis(self._within, self.omega, self.harmonics)

    @cached_property
    def _turns(self) -> NDArray[np.complex128]:
        """How far each harmonic has turned where each of B blocks starts, (B, H)."""
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

        cos jx cos kx = (cos (j - k)x + cos (j + k)x) / 2, and so on: sums of twice as many harmonics tell them all.
        """
        H = self.harmonics
        sums = self._sums(2 * H)
        cosines, sines = np.append(sums[0], sums[1::2]), np.append(0.0, sums[2::2])
        k = np.arange(H + 1)
        ahead, behind = k[:, None] + k, k[:, None] - k
        sine_behind = np.sign(behind) * sines[np.abs(behind)]
        gram = np.empty((2 * H + 1, 2 * H + 1))
        of_cosine, of_sine = np.append(0, k[1:] * 2 - 1), k[1:] * 2
        gram[np.ix_(of_cosine, of_cosine)] = (cosines[np.abs(behind)] + cosines[ahead]) / 2.0
        gram[np.ix_(of_sine, of_sine)] = (cosines[np.abs(behind)] - cosines[ahead])[1:, 1:] / 2.0
        gram[np.ix_(of_sine, of_cosine)] = (sines[ahead] + sine_behind)[1:] / 2.0
        gram[np.ix_(of_cosine, of_sine)] = gram[np.ix_(of_sine, of_cosine)].T
        return gram

    def _sums(self, harmonics: int) -> Array:
        """The basis of so many harmonics, summed over all times: (2 H + 1,)."""
        sums: Array = basis(self._starts, self.omega, harmonics).sum(axis=0)
        within = basis(self._within, self.omega, harmonics).sum(axis=0)
        sums[0] *= within[0]
        _pairs(sums)[:] *= _pairs(within)
        for _, F in self._blocks(harmonics):
            sums += F.sum(axis=0)
        return sums

    def _blocks(self, harmonics: int) -> Iterator[tuple[slice, Array]]:
        """Blocks of the samples that no other block serves, each with its basis (n, 2 H + 1)."""
        for start in range(self._even, self._size, BLOCK):
            part = slice(start, min(start + BLOCK, self._size))
            yield part, basis(self._rest[start - self._even : part.stop - self._even], self.omega, harmonics)


def project(t: Array, x: Array, omega: float, harmonics: int) -> Array:
    """The coefficients closest to the samples (N,) in the least squares sense."""
    return Harmonics(t, omega, harmonics).project(x)


def evaluate(c: Array, t: Array, omega: float) -> Array:
    """The signal (N,) that the coefficients describe."""
    return Harmonics(t, omega, len(c) // 2).evaluate(c)


def _pairs(parts: Array) -> NDArray[np.complex128]:
    """The cosine and sine parts (..., 2 H + 1) of each harmonic as one number (..., H), in the same memory."""
    return parts[..., 1:].view(np.complex128)


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


def kept_noise(sigma: float, K: int, harmonics: int, omega: float) -> Array:
    """What the kept harmonics leave of white noise in K samples of a period: covariance (3, 3) of x, dx and ddx.

    Each harmonic keeps 2 sigma^2 / K and the mean half of that; a derivative is a quarter of a turn ahead, so that only
    x and ddx go together.
    """
    rate = omega * np.arange(1, harmonics + 1)
    own = sigma**2 / K * (1.0 + 2.0 * harmonics)
    of_dx, of_ddx = (2.0 * sigma**2 / K * float((rate**order).sum()) for order in (2, 4))
    return np.array([[own, 0.0, -of_dx], [0.0, of_dx, 0.0], [-of_dx, 0.0, of_ddx]])
