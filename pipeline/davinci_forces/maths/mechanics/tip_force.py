"""The force at the tip from external efforts at the joints, its covariance, and the poses that determine it.

tau_ext = J' w                                                                     (7.17), (7.18), (7.25)
w = J^-T tau_ext,    C_w = J^-T C_tau J^-1                                         (7.26)

For three joints, J is J_v and w the force [N].  For six joints, J is J_v above J_omega, and w the wrench: force [N] and
moment [N m].  Shapes: k is 3 or 6, after any leading axes.

Logs share one correlation between the errors of several joints, which is shrunk by the spread between logs:

R = (1 - s) I + s mean(R_i),    s = max(0, 1 - var / mean_of_squares)

with the correlations R_i of n logs, and var the variance of their mean, estimated from the spread between logs.  If the
logs disagree, the shared correlation is 0.  For a single log it is 0 too: nothing shows whether the value repeats.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import jacobian

# The condition number of J_v is the largest ratio of the force errors in two directions.  Like the Jacobian, it mixes
# metres per radian with metres per metre.  Above this number a pose is singular: the efforts of the first three joints
# practically do not determine one direction of the force.  This is 0.1 mm from an exact singularity.  Within Table 6.2
# the number is at most 60.
SINGULAR = 1e4
# Above this condition number a force is marked: its error in one direction is a hundred times the error in another, for
# example if a joint has a lever of about a centimetre at the tip.  Poses within Table 6.2 stay below.
NEAR_SINGULAR = 1e2
DOUBLE = 1e-6  # [m] largest imaginary part of a double root: the square root of the rounding
ARM = 3  # coordinates of the reduced Jacobian
CHI_SQUARED_95 = 7.814727903251179  # 95 % quantile of chi-squared with 3 degrees of freedom


def is_singular(chain: Chain, q: ArrayLike) -> NDArray[np.bool_]:
    """Whether the first three joints do not determine the force at the tip, at q (..., n).  (7.26)"""
    J_v, _ = jacobian(chain, q)
    return np.asarray(np.linalg.cond(J_v[..., :ARM]) > SINGULAR)


def singular_slides(chain: Chain, q_pitch: float) -> Array:
    """Slides at which J_v of the first three joints is singular at this pitch, ascending (0, 1 or 2,) [m].

    det J_v is quadratic in q3, since the levers of roll and pitch are linear in it, and does not depend on the roll.
    """
    q = np.array([[0.0, q_pitch, slide] for slide in (-1.0, 0.0, 1.0)])
    low, middle, high = np.linalg.det(jacobian(chain, q)[0])
    square, linear = (low + high) / 2.0 - middle, (high - low) / 2.0
    scale = max(abs(square), abs(linear), abs(middle))
    roots = np.roots([0.0 if abs(x) < 1e-12 * scale else x for x in (square, linear, middle)])
    return np.sort(roots[np.abs(roots.imag) < DOUBLE].real)


def from_efforts(J: ArrayLike, tau_ext: ArrayLike, C_tau: ArrayLike) -> tuple[Array, Array]:
    """Force or wrench w (..., k) and C_w (..., k, k) from efforts (..., k) and C_tau; NaN at singular poses.  (7.26)"""
    J, tau_ext = np.asarray(J, float), np.asarray(tau_ext, float)
    C_tau = np.broadcast_to(np.asarray(C_tau, float), J.shape)
    w, C_w = np.full(tau_ext.shape, np.nan), np.full(J.shape, np.nan)
    regular = np.linalg.cond(J) <= SINGULAR
    inverse = np.linalg.inv(np.swapaxes(J[regular], -1, -2))  # J^-T
    w[regular] = np.einsum("...ij,...j->...i", inverse, tau_ext[regular])
    C_w[regular] = inverse @ C_tau[regular] @ np.swapaxes(inverse, -1, -2)
    return w, C_w


def covariance(std: ArrayLike, correlation: ArrayLike) -> Array:
    """The covariance (..., k, k) of efforts with these standard deviations (..., k) and correlations (k, k)."""
    std = np.asarray(std, float)
    return np.asarray(std[..., :, None] * np.asarray(correlation, float) * std[..., None, :])


def sigma_ellipsoid(C: ArrayLike) -> tuple[Array, Array]:
    """Half-axes (..., 3) of the 1-sigma ellipsoid of C (..., 3, 3), the longest first, and directions in rows."""
    values, vectors = np.linalg.eigh(np.asarray(C, float))
    sigma = np.sqrt(np.maximum(values[..., ::-1], 0.0))
    directions = np.swapaxes(vectors[..., ::-1], -1, -2)
    largest = np.take_along_axis(directions, np.abs(directions).argmax(-1)[..., None], -1)
    return sigma, directions * np.sign(largest)  # an axis has no sign: its largest component is taken as positive


def reach_95(f: ArrayLike, C: ArrayLike) -> Array:
    """Largest |f| (...,) along f (..., 3) at which the 95 % ellipsoid of C (..., 3, 3) about f contains 0."""
    f, C = np.asarray(f, float), np.asarray(C, float)
    size = np.linalg.norm(f, axis=-1)
    u = np.divide(f, size[..., None], out=np.zeros(f.shape), where=size[..., None] > 0.0)
    u[..., 0] += size == 0.0  # any direction for a force of 0
    squared = np.einsum("...i,...i->...", u, np.linalg.solve(C, u[..., None])[..., 0])
    return np.asarray(np.sqrt(CHI_SQUARED_95 / squared))


def lever(J: ArrayLike) -> Array:
    """Tip force (..., k) [N] per unit of each effort: the lengths of the columns of J^-T."""
    return np.asarray(np.linalg.norm(np.linalg.inv(np.swapaxes(np.asarray(J, float), -1, -2))[..., :3, :], axis=-2))


def shared_correlations(rho: Array) -> Array:
    """The correlations (p,) that n logs (n, p) share; 0 for fewer than two logs."""
    if len(rho) < 2:
        return np.zeros(rho.shape[1])
    mean, var = rho.mean(0), rho.var(0, ddof=1) / len(rho)
    squares = float(np.sum(mean**2))
    share = max(0.0, 1.0 - float(var.sum()) / squares) if squares else 0.0
    return np.asarray(share * mean)


def matrix(rho_12: float, rho_13: float, rho_23: float) -> Array:
    """The correlations of three joints as a matrix (3, 3)."""
    return np.array([[1.0, rho_12, rho_13], [rho_12, 1.0, rho_23], [rho_13, rho_23, 1.0]])
