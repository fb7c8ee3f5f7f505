"""How far parameters of least squares may be off where residuals are correlated.

    r = (1 - Q Q') e,    cov(e) = sigma^2 Omega,    cov(Q' e) = sigma^2 Q' Omega Q

Omega is that of a first-order autoregression and white noise on a period, which repeats: a model's error is slow, the
noise of averaged samples is not, and one correlation for both would be that of the faster.  On a period Omega is a
matter of frequencies,

    S(w) = (1 - a) (1 - rho^2) / (1 + rho^2 - 2 rho cos w) + a,    rho = exp(-1/T)

so every candidate of T and a costs a product of small matrices.  Each counts by its restricted likelihood, that of what
is left when p columns have been fitted: the residuals' own correlation is biased by those.  (Patterson and Thompson,
1971; Harville, 1974.)  The covariance is the mean over candidates, because one correlation, taken as known, covers too
little where a period holds only a dozen correlation times.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

TIMES = 24  # correlation times T, besides none, evenly spaced in their logarithm
SHORTEST = 0.3  # [samples]
LONGEST = 0.25  # of the longest log
WHITE = np.array([0.0, 0.03, 0.1, 0.3, 0.6])  # shares a of white noise in the variance
SINGLE, BANDS = 64, 120  # frequencies that stand alone, and bands of those beyond
SMALLEST = np.finfo(float).tiny


class Bands(NamedTuple):
    """What the logs hold in B bands of frequency."""

    frequency: Array  # (B,) [rad/sample]
    number: Array  # (B,) of frequencies in the band
    basis: Array  # (B, p, p) of the columns Q
    cross: Array  # (B, p) of columns and residuals
    power: Array  # (B,) of the residuals


class Correlated(NamedTuple):
    """The variance of parameters, and over how many lags the residuals that it comes from are correlated."""

    variance: Array  # (p,)
    lags: float


def correlated(Q: Array, residual: Array, starts: tuple[int, ...], D: Array, degrees: int) -> Correlated:
    """The variance of D y for y = Q' tau, given orthonormal columns Q (K, p), D (p, p) and the residuals (K,).

    Each log is a period that begins where `starts` says; `degrees` are K - p.  Where residuals are larger in one part
    of the period than in another, so is what parameters that depend on this part may err by.
    """
    bands = banded(Q, residual, starts)
    S, lags = candidates(bands.frequency, max(np.diff([*starts, len(Q)])))
    share, scale = weighed(bands, S, degrees)
    mean = (share * scale) @ S
    covariance = np.einsum("b,bij->ij", mean, bands.basis)
    variance = np.einsum("ki,ij,kj->k", D, covariance, D)
    factor = unevenness(Q, residual, starts, D, np.maximum(mean, SMALLEST), bands.frequency)
    return Correlated(variance * factor, float(share @ lags))


def banded(Q: Array, residual: Array, starts: tuple[int, ...]) -> Bands:
    """The columns' and the residuals' spectra, in bands that widen with frequency."""
    parts = []
    for own, r in zip(np.split(Q, starts[1:]), np.split(residual, starts[1:]), strict=True):
        f, g = np.fft.rfft(own, axis=0, norm="ortho"), np.fft.rfft(r, norm="ortho")
        w = np.full(len(g), 2.0)
        w[0] = 1.0
        w[-1] = 1.0 + len(r) % 2 if len(r) > 1 else 1.0
        edges = np.unique(np.r_[: min(SINGLE, len(g)), np.geomspace(SINGLE, len(g), BANDS)[:-1].astype(int)])
        edges = edges[edges < len(g)]
        count = np.add.reduceat(w, edges)
        basis = [np.add.reduceat(w[:, None] * (f[:, [i]] * f.conj()).real, edges) for i in range(f.shape[1])]
        parts.append(
            Bands(
                np.add.reduceat(w * np.arange(len(g)), edges) / count * 2 * np.pi / len(r),
                count,
                np.stack(basis, axis=1),
                np.add.reduceat(w[:, None] * (f.conj() * g[:, None]).real, edges),
                np.add.reduceat(w * np.abs(g) ** 2, edges),
            )
        )
    return Bands(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def candidates(frequency: Array, K: int) -> tuple[Array, Array]:
    """S (G, B) of every correlation time and share of white noise; and their correlations (G,), summed over lags."""
    times = np.concatenate([[1e-3], np.geomspace(SHORTEST, max(LONGEST * K, 1.0), TIMES)])
    rho, a = (x.ravel() for x in np.meshgrid(np.exp(-1.0 / times), WHITE, indexing="ij"))
    slow = (1 - rho**2)[:, None] / (1 + rho[:, None] ** 2 - 2 * rho[:, None] * np.cos(frequency))
    return (1 - a)[:, None] * slow + a[:, None], (1 - a) * 2 * rho / (1 - rho)


def weighed(bands: Bands, S: Array, degrees: int) -> tuple[Array, Array]:
    """The share (G,) that each candidate has by its restricted likelihood, and its estimate of sigma^2 (G,)."""
    G, p = len(S), bands.cross.shape[1]
    normal = (1 / S @ bands.basis.reshape(-1, p * p)).reshape(G, p, p)
    moved = np.linalg.solve(normal, (1 / S @ bands.cross)[:, :, None])[:, :, 0]
    squares = 1 / S @ bands.power - np.einsum("gi,gij,gj->g", moved, normal, moved)
    squares = np.maximum(squares, SMALLEST)
    logarithm = np.log(S) @ bands.number + np.linalg.slogdet(normal)[1] + degrees * np.log(squares)
    even = np.where(np.arange(G) < len(WHITE), (G - len(WHITE)) / len(WHITE), 1.0)  # correlated or not: even odds
    share = even * np.exp(0.5 * (logarithm.min() - logarithm))
    return share / share.sum(), squares / degrees


def unevenness(Q: Array, residual: Array, starts: tuple[int, ...], D: Array, S: Array, frequency: Array) -> Array:
    """By how much the variances (p,) of D y differ from those of innovations that are as large everywhere.

    With u = Omega^(-1/2) e the innovations and h the rows of D Q' Omega^(1/2), D Q' e = sum of h_k u_k: its variance is
    the sum of h_k^2 u_k^2, and would be that of h_k^2 times the mean of u^2.  (White, 1980)
    """
    order = np.argsort(frequency, kind="stable")
    sums = np.zeros((3, len(D)))
    for own, r in zip(np.split(Q, starts[1:]), np.split(residual, starts[1:]), strict=True):
        K = len(r)
        root = np.sqrt(np.interp(2 * np.pi * np.arange(K // 2 + 1) / K, frequency[order], S[order]))
        u2 = np.fft.irfft(np.fft.rfft(r) / root, K) ** 2
        h2 = (np.fft.irfft(np.fft.rfft(own, axis=0) * root[:, None], K, axis=0) @ D.T) ** 2
        sums += np.stack([u2 @ h2, h2.sum(axis=0), np.full(len(D), u2.sum())])
    return np.asarray(np.where(sums[2] > 0, sums[0] * len(Q) / np.maximum(sums[1] * sums[2], SMALLEST), 1.0))
