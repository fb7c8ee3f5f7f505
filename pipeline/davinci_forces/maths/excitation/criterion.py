"""How well a regressor tells its parameters apart: the criteria of an excitation, of one regressor or of many.

A regressor is F (..., K, p); what is infinite has no full rank.
"""

from collections.abc import Callable

import numpy as np

from davinci_forces.maths.arrays import Array

Criterion = Callable[[Array], Array]
# Numbers of a matrix that is made a triangle at once: for more, the library starts threads, which thousands of times a
# second cost more than they save, and on a busy machine 20 times as much.
BLOCK = 8000


def determinant(F: Array) -> Array:
    """-log10 det(F^T F) (...).  (6.20)"""
    diagonal = np.abs(np.diagonal(triangle(F), axis1=-2, axis2=-1))
    return _where_full_rank(F, diagonal.min(-1), diagonal.max(-1), lambda: -2 * np.log10(diagonal).sum(-1))


def condition(F: Array) -> Array:
    """log10 of the condition number (...)."""
    s: Array = np.asarray(np.linalg.svd(triangle(F), compute_uv=False), np.float64)
    return _where_full_rank(F, s[..., -1], s[..., 0], lambda: np.log10(s[..., 0] / s[..., -1]))


def triangle(F: Array) -> Array:
    """R (..., p, p) of F = Q R, from the R of blocks of samples where there are many."""
    samples, parameters = F.shape[-2:]
    rows = max(2 * parameters, BLOCK // parameters)
    if samples <= rows:
        return np.asarray(np.linalg.qr(F, mode="r"))
    blocks = [np.linalg.qr(F[..., i : i + rows, :], mode="r") for i in range(0, samples, rows)]
    return triangle(np.concatenate(blocks, axis=-2))


def _where_full_rank(F: Array, smallest: Array, largest: Array, value: Callable[[], Array]) -> Array:
    samples, parameters = F.shape[-2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        full = (samples >= parameters) & (smallest > samples * np.finfo(float).eps * largest)
        return np.where(full, value(), np.inf)


CRITERIA: dict[str, Criterion] = {"determinant": determinant, "condition": condition}
