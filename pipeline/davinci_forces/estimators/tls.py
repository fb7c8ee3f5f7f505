"""Total least squares: parameters from columns that have noise of their own, as large as is known of the motion.

    theta = arg min |tau - Phi theta|^2 / (v + theta' C theta)

C is what the noise of the motion makes of Phi' Phi, and v that of the effort.  Columns without noise stay as they are:
QR takes them out, and of the others, each over its noise, the smallest singular direction is what noise made.  Golub
and Van Loan, An analysis of the total least squares problem, 1980; Van Huffel and Vandewalle, The Total Least Squares
Problem, 1991, section 3.5 (generalised: mixed, and correlated noise).
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimate, Regression, Spread, spread_by
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Triangle

NAME = "total least squares"
EXACT = 1e-12  # of the noisiest combination's variance, below which one has no noise
STEPS = 100
SETTLED = 1e-10  # of the effort's noise
BURIED = 0.5  # share of a combination's square that may be noise: where more is, what is left is not known


class Noise(NamedTuple):
    """What noise makes of the squares of p scaled columns, in its own axes: C = V diag(variance) V'."""

    axes: Array  # V (p, p), those without noise first
    variance: Array  # (p,)


def estimate(problem: Regression) -> Estimate:
    """theta of the smallest singular value of columns and effort, each over its noise; least squares where none has.

    The effort's noise v is what parameters leave beyond the columns' own part, for a model errs, too; at least it is
    what periods differ by.  The standard errors are those of the estimating equation (Phi' Phi - C) theta = Phi' tau by
    residuals, which hold both noises: right to first order for the classical ones.  The others ask of noise in columns
    that it be as smooth as they are, as that of kept harmonics is.  White noise there explains the residual where
    nothing else does, is taken for correlation, and makes them too large.  What noise does to the columns without
    being left in the residual, none of them tells.

    Raises
    ------
    NotIdentifiable
        If the noise of the columns is not known, or buries what they show, and where least squares raise it.
    """
    weight, R = problem.weight, problem.triangle
    if problem.Phi_cov is None:
        raise NotIdentifiable("how noisy the motion is shows where periods repeat: record at least two of them")
    C = noise_of(problem, problem.Phi_cov, weight) / np.outer(R.scale, R.scale)
    if not C.any():
        return Estimate(R.theta, lambda: spread(problem, weight, R, np.zeros_like(C), R.theta))
    refuse_buried(problem, R, C)
    scaled = settled(R, C, float(problem.tau_var @ (weight > 0)))
    return Estimate(scaled / R.scale, lambda: spread(problem, weight, R, C, scaled / R.scale))


def noise_of(problem: Regression, Phi_cov: Array, weight: Array) -> Array:
    """C (p, p): what errors of the rows add to Phi' Phi, over all logs."""
    counts = np.add.reduceat(weight, problem.starts)
    return np.asarray(np.einsum("s,spq->pq", counts, Phi_cov))


def refuse_buried(problem: Regression, R: Triangle, C: Array) -> None:
    """Stop where noise is as large as what is left of a combination of columns without the others."""
    inverse = np.linalg.inv(R.U)
    share, axes = np.linalg.eigh(inverse.T @ C @ inverse)
    if share[-1] > BURIED:
        part = np.sqrt(np.diag(C)) * np.abs(inverse @ axes[:, -1])
        buried = ", ".join(name for name, x in zip(problem.names, part, strict=True) if x > 0.5 * part.max())
        said = f"noise makes {100 * share[-1]:.2g} % of what the motion shows of {buried}"
        raise NotIdentifiable(f"{said}; record more of it, or more periods")


def settled(R: Triangle, C: Array, least: float) -> Array:
    """Scaled parameters (p,) with the noise of the effort that they leave, `least` or more."""
    variance, axes = np.linalg.eigh(C)
    noise = Noise(axes, np.where(variance > EXACT * variance[-1], variance, 0.0))
    theta = R.theta * R.scale
    floor = max(least, SETTLED * float(R.y @ R.y + R.squares))
    v = 0.0
    for _ in range(STEPS):
        left = R.squares + float(((R.U @ theta - R.y) ** 2).sum())
        before, v = v, max(left - float(theta @ C @ theta), floor)
        theta = smallest(R, noise, v)
        if abs(v - before) <= SETTLED * v:
            break
    return theta


def smallest(R: Triangle, noise: Noise, v: float) -> Array:
    """The scaled parameters (p,) where the effort's noise is v: QR without the exact columns, then SVD of the rest."""
    p = len(R.y)
    whole = np.zeros((p + 1, p + 1))
    whole[:p, :p], whole[:p, p], whole[p, p] = R.U @ noise.axes, R.y, np.sqrt(R.squares)
    (T,) = qr(whole, mode="r")
    k = int((noise.variance == 0).sum())
    sizes = np.sqrt(np.r_[noise.variance[k:], v])
    _, _, right = np.linalg.svd(T[k:, k:] / sizes)
    noisy = right[-1] / sizes
    z = -noisy[:-1] / noisy[-1]
    exact = np.linalg.solve(T[:k, :k], T[:k, p] - T[:k, k:p] @ z)
    return np.asarray(noise.axes @ np.r_[exact, z])


def spread(problem: Regression, weight: Array, R: Triangle, C: Array, theta: Array) -> Spread:
    """The standard errors, by G = Phi' Phi - C in place of Phi' Phi."""
    Q = problem.Phi * np.sqrt(weight)[:, None] @ (np.linalg.inv(R.U) / R.scale[:, None])
    D = np.linalg.solve(R.U.T @ R.U - C, R.U.T) / R.scale[:, None]
    return spread_by(problem, weight, theta, Q, D)
