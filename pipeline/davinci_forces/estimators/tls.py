"""Total least squares: parameters from columns with noise, as large as the measured noise of the motion.

    theta = arg min |tau - Phi theta|^2 / (v + theta' C theta)

C is what the noise of the motion adds to Phi' Phi, and v the variance of the effort's noise.  QR eliminates columns
without noise.  Of the others, each over its noise, the smallest singular direction is noise.  Golub and Van Loan, An
analysis of the total least squares problem, 1980; Van Huffel and Vandewalle, The Total Least Squares Problem, 1991,
section 3.5 (generalised: mixed, and correlated noise).
"""

import numpy as np
from scipy.linalg import qr

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimate, Regression, StandardErrors, standard_errors_by
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Triangle

NAME = "total least squares"
EXACT = 1e-12  # a combination with a smaller share of the noisiest one's variance has no noise
MAX_STEPS_TLS = 100
TOLERANCE_TLS = 1e-10  # relative change of the effort's noise at which the iteration stops
MAX_NOISE_SHARE = 0.5  # with a larger share of noise in a combination's square, its motion is not known


def estimate(problem: Regression) -> Estimate:
    """Find theta of the smallest singular value of columns and effort over their noise; without noise, least squares.

    The effort's noise v is the residual without the part of the columns' noise, because it includes the model's error.
    It is at least the variance between periods.  The standard errors are those of (Phi' Phi - C) theta = Phi' tau, from
    residuals, which contain both noises.  The classical errors are right to first order.  The others assume that the
    noise in a column is as smooth as the column, as noise of kept harmonics is; white noise in columns would make them
    too large.  Neither includes noise of the columns that is not in the residual.

    Raises NotIdentifiable if the noise of the columns is not known or too large, or if least squares raise this error.
    """
    R = problem.triangle
    if problem.Phi_cov is None:
        raise NotIdentifiable("the noise of the motion is not known without repeated periods: record at least two")
    counts = np.add.reduceat(problem.weight, problem.starts)
    C = np.einsum("s,spq->pq", counts, problem.Phi_cov) / np.outer(R.scale, R.scale)
    if not C.any():
        return Estimate(R.theta, lambda: standard_errors(problem, np.zeros_like(C), R.theta))
    refuse_noisy(problem, R, C)
    scaled = fit_scaled(R, C, float(problem.tau_var @ (problem.weight > 0)))
    return Estimate(scaled / R.scale, lambda: standard_errors(problem, C, scaled / R.scale))


def refuse_noisy(problem: Regression, R: Triangle, C: Array) -> None:
    """Raise NotIdentifiable if more than half the square of a combination of columns, without the others, is noise."""
    inverse = np.linalg.inv(R.U)
    share, axes = np.linalg.eigh(inverse.T @ C @ inverse)
    if share[-1] > MAX_NOISE_SHARE:
        part = np.sqrt(np.diag(C)) * np.abs(inverse @ axes[:, -1])
        noisy = ", ".join(name for name, x in zip(problem.names, part, strict=True) if x > 0.5 * part.max())
        percent = f"{100 * share[-1]:.0f} %"
        raise NotIdentifiable(f"noise is {percent} of the excitation of {noisy}; record more of it, or more periods")


def fit_scaled(R: Triangle, C: Array, v_min: float) -> Array:
    """Fit the scaled parameters (p,) with the effort's noise from their residual, at least `v_min`."""
    variance, axes = np.linalg.eigh(C)
    variance = np.where(variance > EXACT * variance.max(), variance, 0.0)
    theta = R.theta * R.scale
    floor = max(v_min, TOLERANCE_TLS * float(R.y @ R.y))
    v = np.inf
    for _ in range(MAX_STEPS_TLS):
        squares = R.min_squares + float(((R.U @ theta - R.y) ** 2).sum())
        before, v = v, max(squares - float(theta @ C @ theta), floor)
        theta = fit_for_noise(R, axes, variance, v)
        if abs(v - before) <= TOLERANCE_TLS * v:
            break
    return theta


def fit_for_noise(R: Triangle, axes: Array, variance: Array, v: float) -> Array:
    """Fit the scaled parameters (p,) for noise v of the effort: QR of the exact columns, then SVD of the others.

    C = V diag(variance) V' is the noise in the squares of the columns, its axes V (p, p) without noise first.
    """
    p = len(R.y)
    M = np.zeros((p + 1, p + 1))
    M[:p, :p], M[:p, p], M[p, p] = R.U @ axes, R.y, np.sqrt(R.min_squares)
    (T,) = qr(M, mode="r")
    k = int((variance == 0).sum())
    sizes = np.sqrt(np.r_[variance[k:], v])
    _, _, right = np.linalg.svd(T[k:, k:] / sizes)
    noisy = right[-1] / sizes
    z = -noisy[:-1] / noisy[-1]
    exact = np.linalg.solve(T[:k, :k], T[:k, p] - T[:k, k:p] @ z)
    return np.asarray(axes @ np.r_[exact, z])


def standard_errors(problem: Regression, C: Array, theta: Array) -> StandardErrors:
    """Compute the standard errors with G = Phi' Phi - C in place of Phi' Phi."""
    R = problem.triangle
    Q = problem.Phi * np.sqrt(problem.weight)[:, None] @ (np.linalg.inv(R.U) / R.scale[:, None])
    D = np.linalg.solve(R.U.T @ R.U - C, R.U.T) / R.scale[:, None]
    return standard_errors_by(problem, theta, Q, D)
