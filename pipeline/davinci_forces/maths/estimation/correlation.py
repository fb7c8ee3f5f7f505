"""The variance of least-squares parameters where residuals are correlated.

    r = (1 - Q Q') e,    cov(e) = sigma^2 Omega,    cov(Q' e) = sigma^2 Q' Omega Q

Omega is that of a first-order autoregression plus white noise on a repeated period.  A model's error is slow and the
noise of averaged samples is not, so one correlation for both would describe only the faster.  On a period Omega is
diagonal in frequency,

    S(w) = (1 - a) (1 - rho^2) / (1 + rho^2 - 2 rho cos w) + a,    rho = exp(-1/T)

so a candidate of T and a costs a product of small matrices.  Its weight is its restricted likelihood, which allows for
the p fitted columns, which bias the correlation of the residuals.  (Patterson and Thompson, 1971; Harville, 1974.)
The covariance is the mean over candidates: one alone gives too little coverage for a dozen correlation times a period.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array

TIMES = 24  # number of correlation times T, evenly spaced in their logarithm; one more candidate has none
SHORTEST_TIME = 0.3  # [samples]
LONGEST_TIME = 0.25  # as a share of the longest log
WHITE = np.array([0.0, 0.03, 0.1, 0.3, 0.6])  # shares a of white noise in the variance
SINGLE, BANDS = 64, 120  # number of lowest frequencies with one band each, and of bands for all higher frequencies
CACHED_ROWS = 8192  # rows that are processed together: they fit into the processor's cache
SMALLEST = np.finfo(float).tiny
Spectra = list[tuple[NDArray[np.complex128], int]]  # F (p + 1, K // 2 + 1) of columns and residuals, and K, per log


class Bands(NamedTuple):
    """The spectra of the logs in B bands of frequency."""

    frequency: Array  # (B,) [rad/sample]
    number: Array  # (B,) frequencies in the band
    basis: Array  # (B, p, p) products of the columns Q
    cross: Array  # (B, p) products of columns and residuals
    power: Array  # (B,) squares of the residuals


def correlated_variance(
    Q: Array, residual: Array, starts: tuple[int, ...], D: Array, degrees: int
) -> tuple[Array, float]:
    """Variance (p,) of D y for y = Q' tau, from orthonormal columns Q (K, p), D (p, p) and the residuals (K,).

    Each log is a period that begins at its entry of `starts`; `degrees` is K - p.  Larger residuals in one part of the
    period increase the variance of the parameters that depend on this part.  The second result is the number of lags
    over which the residuals are correlated.
    """
    spectra = transform_logs(Q, residual, starts)
    bands = band_spectra(spectra)
    S, lags = candidates(bands.frequency, max(K for _, K in spectra))
    share, scale = weigh_candidates(bands, S, degrees)
    mean = (share * scale) @ S
    covariance = np.einsum("b,bij->ij", mean, bands.basis)
    variance = np.einsum("ki,ij,kj->k", D, covariance, D)
    factor = unevenness(spectra, D, np.maximum(mean, SMALLEST), bands.frequency)
    return variance * factor, float(share @ lags)


def transform_logs(Q: Array, residual: Array, starts: tuple[int, ...]) -> Spectra:
    """Fourier-transform each log's part of columns (K, p) and residuals (K,)."""
    lengths = np.diff([*starts, len(Q)])
    ends = np.cumsum(lengths // 2 + 1)
    memory = np.empty((Q.shape[1] + 1, ends[-1]), complex)  # one allocation takes a third of the time of one per log
    spectra = []
    for first, K, F in zip(starts, lengths.tolist(), np.split(memory, ends[:-1], axis=1), strict=True):
        np.fft.rfft(Q[first : first + K].T, norm="ortho", out=F[:-1])
        np.fft.rfft(residual[first : first + K], norm="ortho", out=F[-1])
        spectra.append((F, K))
    return spectra


def band_spectra(spectra: Spectra) -> Bands:
    """Sum the spectra of columns and residuals in bands that widen with frequency; logs of equal length share bands."""
    parts = []
    for K in dict.fromkeys(K for _, K in spectra):
        logs, n = [F for F, samples in spectra if samples == K], K // 2 + 1
        edges = np.unique(np.r_[: min(SINGLE, n), np.geomspace(SINGLE, n, BANDS)[:-1].astype(int)])
        edges = edges[edges < n]
        w = np.full(n, 2.0)
        w[[0, -1]] = 1.0, 1.0 + K % 2 if K > 1 else 1.0
        count = np.add.reduceat(w, edges)
        frequency = np.add.reduceat(w * np.arange(n), edges) / count * 2 * np.pi / K
        numbers = [F.view(float) for F in logs]  # real and imaginary parts, in turn
        columns = (np.hstack([x[:, a:b] for x in numbers]) for a, b in pairwise(2 * np.append(edges, n)))
        G = np.stack([2.0 * band @ band.T for band in columns])
        for k in np.flatnonzero(w == 1.0):  # frequencies without a negative counterpart
            real = np.column_stack([F[:, k].real for F in logs])
            G[-1 if k else 0] -= real @ real.T
        parts.append(Bands(frequency, len(logs) * count, G[:, :-1, :-1], G[:, :-1, -1], G[:, -1, -1]))
    return Bands(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def candidates(frequency: Array, K: int) -> tuple[Array, Array]:
    """Spectra S (G, B) of all correlation times and shares of white noise, and the sums (G,) of their correlations."""
    times = np.geomspace(SHORTEST_TIME, max(LONGEST_TIME * K, 1.0), TIMES)
    rho, a = (x.ravel() for x in np.meshgrid(np.append(0.0, np.exp(-1.0 / times)), WHITE, indexing="ij"))
    slow = (1 - rho**2)[:, None] / (1 + rho[:, None] ** 2 - 2 * rho[:, None] * np.cos(frequency))
    return (1 - a)[:, None] * slow + a[:, None], (1 - a) * 2 * rho / (1 - rho)


def weigh_candidates(bands: Bands, S: Array, degrees: int) -> tuple[Array, Array]:
    """Weight (G,) of each candidate by its restricted likelihood, and its estimate of sigma^2 (G,)."""
    G, p = len(S), bands.cross.shape[1]
    normal = (1 / S @ bands.basis.reshape(-1, p * p)).reshape(G, p, p)
    shift = np.linalg.solve(normal, (1 / S @ bands.cross)[:, :, None])[:, :, 0]
    squares = 1 / S @ bands.power - np.einsum("gi,gij,gj->g", shift, normal, shift)
    squares = np.maximum(squares, SMALLEST)
    logarithm = np.log(S) @ bands.number + np.linalg.slogdet(normal)[1] + degrees * np.log(squares)
    prior = np.where(np.arange(G) < len(WHITE), (G - len(WHITE)) / len(WHITE), 1.0)  # even odds of correlation
    share = prior * np.exp(0.5 * (logarithm.min() - logarithm))
    return share / share.sum(), squares / degrees


def unevenness(spectra: Spectra, D: Array, S: Array, frequency: Array) -> Array:
    """Factors (p,) of the variances of D y against those of innovations of constant variance.

    With u = Omega^(-1/2) e the innovations and h the rows of D Q' Omega^(1/2), D Q' e = sum of h_k u_k.  Its variance
    is the sum of h_k^2 u_k^2; with even residuals it is the sum of h_k^2 times the mean of u^2.  (White, 1980)
    """
    order = np.argsort(frequency, kind="stable")
    sums = np.zeros((3, len(D)))
    for F, K in spectra:
        root = np.sqrt(np.interp(2 * np.pi * np.arange(F.shape[1]) / K, frequency[order], S[order]))
        numbers, both_parts = F.view(float), np.repeat(root, 2)
        numbers[:-1] *= both_parts
        numbers[-1] /= both_parts
        columns = np.fft.irfft(F, K, norm="ortho")
        for first in range(0, K, CACHED_ROWS):
            block = columns[:, first : first + CACHED_ROWS]
            u2, h2 = block[-1] ** 2, (D @ block[:-1]) ** 2
            sums += np.stack([h2 @ u2, h2.sum(axis=1), np.full(len(D), u2.sum())])
    samples = sum(K for _, K in spectra)
    return np.asarray(np.where(sums[2] > 0, sums[0] * samples / np.maximum(sums[1] * sums[2], SMALLEST), 1.0))
