"""How well a regressor tells its parameters apart: the criteria of an excitation, of one regressor or of many.

A regressor is F (..., K, p); what is infinite has no full rank.
"""

from collections.abc import Callable

import numpy as np

from pipeline.maths.arrays import Array

Criterion = Callable[[Array], Array]


def determinant(F: Array) -> Array:
    """-log10 det(F^T F) (...).  (6.20)"""
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
