"""Models of tissue: its force by depth and velocity, and the model that best predicts pushes outside its fit.

    spring          f = c + k x                                          (8.1)

    Kelvin-Voigt    f = c + k x + b v

    Hunt-Crossley   f = c + k x^n + b x^n v

x is the depth below first contact and v its rate.  Each push has its own offset c.  For a given exponent n all models
are linear: a push contributes small matrices of products, which are subtracted from the sums to leave the push out.

Hunt and Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Applied Mechanics 42 (1975).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.uncertainty.bootstrap import blocks, error_of_mean, of_left_out, standard_error

EXPONENTS = np.linspace(1.0, 2.5, 31)
FOLDS = 20


class ForceLaw(NamedTuple):
    """Structure of a model: which of the columns x^n, v and x^n v it has, and whether the exponent is free."""

    name: str
    columns: tuple[int, ...]
    free: bool

    @property
    def parameters(self) -> int:
        """Number of parameters that all pushes share."""
        return len(self.columns) + self.free


LAWS = (
    ForceLaw("spring", (0,), False),
    ForceLaw("Kelvin-Voigt", (0, 1), False),
    ForceLaw("power law", (0,), True),
    ForceLaw("Hunt-Crossley", (0, 2), True),
)


class Moments(NamedTuple):
    """Products of the columns and the force of P pushes, less their means, for E exponents."""

    A: Array  # (P, E, 3, 3)
    b: Array  # (P, E, 3)
    squares: Array  # (P,)


class FittedLaw(NamedTuple):
    """A model fitted to all pushes, and its errors on pushes that were left out of a fit."""

    law: ForceLaw
    errors: Array  # (folds,) squares of the errors on omitted pushes
    score: float  # relative error on omitted pushes
    score_std: float
    theta: Array  # (3,) of x^n [N/m^n], v [N s/m] and x^n v [N s/m^(n+1)]
    exponent: float
    left_out: tuple[tuple[Array, float], ...] = ()  # theta and the exponent of each fold's fit


def moments(pushes: Sequence[tuple[Array, Array, Array]]) -> Moments:
    """Compute the moments of pushes, each of depth below first contact [m], its rate [m/s] and force [N], (N,)."""
    A, b, squares = [], [], []
    for x, v, f in pushes:
        columns, away = _columns(x, v, EXPONENTS), f - f.mean()
        columns = columns - columns.mean(axis=0)
        A.append(np.einsum("kei,kej->eij", columns, columns))
        b.append(np.einsum("kei,k->ei", columns, away))
        squares.append(float(away @ away))
    return Moments(np.array(A), np.array(b), np.array(squares))


def cross_validate_law(data: Moments, law: ForceLaw) -> FittedLaw:
    """Fit and cross-validate a model: leave out one push at a time, or a twentieth of all pushes."""
    parts = blocks(len(data.squares), FOLDS)
    A, b, _ = (column.sum(axis=0) for column in data)
    errors, sizes, left_out = np.zeros(len(parts)), np.zeros(len(parts)), []
    for i, part in enumerate(parts):
        A_out, b_out, sizes[i] = (column[part].sum(axis=0) for column in data)
        theta, e = fit_parameters(A - A_out, b - b_out, law)
        errors[i] = sizes[i] - 2 * theta @ b_out[e] + theta @ A_out[e] @ theta
        left_out.append((theta, float(EXPONENTS[e])))
    theta, e = fit_parameters(A, b, law)
    pairs = list(zip(errors.tolist(), sizes.tolist(), strict=True))
    score, std = _relative(pairs), standard_error(_relative, pairs)
    return FittedLaw(law, errors, score, std, theta, float(EXPONENTS[e]), tuple(left_out))


def fit_parameters(A: Array, b: Array, law: ForceLaw) -> tuple[Array, int]:
    """Least-squares parameters (3,) of moments (E, 3, 3) and (E, 3), and the index of the best exponent."""
    which = list(law.columns)
    exponents = range(len(EXPONENTS) if law.free else 1)
    thetas = [np.linalg.lstsq(A[e][np.ix_(which, which)], b[e, which], rcond=1e-12)[0] for e in exponents]
    best = int(np.argmax([theta @ b[e, which] for e, theta in enumerate(thetas)]))
    theta = np.zeros(3)
    theta[which] = thetas[best]
    return theta, best


def force_of(model: FittedLaw, x: Array, v: Array) -> Array:
    """The force (N,) of a model at depths below first contact (N,) and their rates (N,), without the push's own c."""
    return np.asarray(_columns(x, v, np.array([model.exponent]))[:, 0] @ model.theta)


def tangent(model: FittedLaw, x: float) -> tuple[float, float]:
    """Stiffness [N/m] at rest and damping [N s/m] of a model at a depth below first contact [m]."""
    k, b, b_x = model.theta
    return float(k * model.exponent * x ** (model.exponent - 1)), float(b + b_x * x**model.exponent)


def standard_errors(model: FittedLaw, x: float) -> Array:
    """Jackknife the standard errors (3,) of stiffness and damping at a depth [m], and exponent, over the pushes."""
    fits = [model._replace(theta=theta, exponent=exponent) for theta, exponent in model.left_out]
    return of_left_out(np.array([(*tangent(fit, x), fit.exponent) for fit in fits]))


def _columns(x: Array, v: Array, exponents: Array) -> Array:
    """x^n, v and x^n v (N, E, 3) of depths (N,) and their rates (N,)."""
    power = np.clip(x, 0.0, None)[:, None] ** exponents
    return np.stack([power, np.broadcast_to(v[:, None], power.shape), power * v[:, None]], axis=2)


def preferred_law(candidates: Sequence[FittedLaw]) -> tuple[FittedLaw, str]:
    """The model of the fewest parameters that predicts omitted pushes not clearly worse than the best one, and why."""
    best = min(candidates, key=lambda c: c.score)
    worse = [c.errors - best.errors for c in candidates]
    near = [c for c, x in zip(candidates, worse, strict=True) if c is best or x.mean() < error_of_mean(x)]
    chosen = min(near, key=lambda c: (c.law.parameters, c.score))
    if chosen is best:
        return best, "it predicts pushes left out best"
    return chosen, f"{best.law.name} predicts pushes left out better, but by no more than chance does"


def _relative(pairs: list[tuple[float, float]]) -> float:
    """Root of the squared errors over the squared force."""
    errors, sizes = np.array(pairs).T
    return float(np.sqrt(max(errors.sum(), 0.0) / max(sizes.sum(), np.finfo(float).tiny)))
