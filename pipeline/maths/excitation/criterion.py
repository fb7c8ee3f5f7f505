"""How well a regressor tells its parameters apart: the criteria of an excitation, of one regressor or of many.

A regressor is F (..., K, p); what is infinite has no full rank.
"""

from collections.abc import Callable

import numpy as np

from pipeline.maths.arrays import Array

Criterion = Callable[[Array], Array]
FLAT = 1e-6  # det(F^T F) of columns of unit length, below which rounding in F^T F counts


def determinant(F: Array) -> Array:
    """-log10 det(F^T F) (...).  (6.20)

    Where columns of unit length span enough, F^T F says it to a billionth, at a fifth of the time of a triangle of F.
    """
    gram = np.swapaxes(F, -1, -2) @ F
    lengths = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        volume = np.linalg.det(gram / (lengths[..., None] * lengths[..., None, :]))
        value = np.asarray(-np.log10(volume) - 2 * np.log10(lengths).sum(-1))
    flat = ~(volume > FLAT)
    value[flat] = _by_triangle(F[flat])
    return value


def _by_triangle(F: Array) -> Array:
    diagonal = np.abs(np.diagonal(np.linalg.qr(F, mode="r"), axis1=-2, axis2=-1))
    return _where_full_rank(F, diagonal.min(-1), diagonal.max(-1), lambda: -2 * np.log10(diagonal).sum(-1))


def condition(F: Array) -> Array:
    """log10 of the condition number (...)."""
    s = np.linalg.svd(np.linalg.qr(F, mode="r"), compute_uv=False)
    return _where_full_rank(F, s[..., -1], s[..., 0], lambda: np.log10(s[..., 0] / s[..., -1]))


def _where_full_rank(F: Array, smallest: Array, largest: Array, value: Callable[[], Array]) -> Array:
    samples, parameters = F.shape[-2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        full = (samples >= parameters) & (smallest > samples * np.finfo(float).eps * largest)
        return np.where(full, value(), np.inf)


CRITERIA: dict[str, Criterion] = {"determinant": determinant, "condition": condition}
