"""The force at the tip from external efforts at the joints, its covariance, and the poses that determine it.

tau_ext = J' w                                                                     (7.17), (7.18), (7.25)
w = J^-T tau_ext,    C_w = J^-T C_tau J^-1                                         (7.26)

J is J_v of the first three joints, and w the force [N].  Of six joints J is J_v above J_omega, and w the wrench: force
[N] and moment [N m].  Shapes: k is 3 or 6, and any leading axes come before it.

The correlation of the errors of several joints is shared by logs as far as they agree:

R = (1 - s) I + s mean(R_i),    s = max(0, 1 - var / mean_of_squares)

with the correlations R_i of n logs, and var the variance of their mean by the spread between logs.  Logs that disagree
give no correlation.  Nor does a single one, since nothing shows whether it would repeat.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import jacobian

# Above this condition number a pose counts as singular: the first three joints leave one direction of the force
# undetermined in practice.  It is 0.1 mm from an exact singularity; in the box of Table 6.2 it reaches 60.
SINGULAR = 1e4
# Above this one a force is marked: the error of one direction is a hundred times that of another, as where the lever of
# a joint at the tip is about a centimetre.  The box of Table 6.2 stays below.
NEAR_SINGULAR = 1e2
DOUBLE = 1e-6  # [m] imaginary part that rounding, at its square root, gives to a double root
ARM = 3  # coordinates of the reduced Jacobian
CHI_SQUARED_95 = 7.814727903251179  # what 95 % of squared lengths of normal vectors of three components stay below


def condition(J_v: ArrayLike) -> Array:
    """Condition number (...) of J_v (..., 3, n): the largest ratio of the errors of two directions of the force.

    It mixes metres per radian and metres per metre, as the Jacobian itself does.
    """
    values = np.linalg.svd(np.asarray(J_v, float), compute_uv=False)
    smallest = values[..., -1]
    infinite = np.full(smallest.shape, np.inf)
    return np.asarray(np.divide(values[..., 0], smallest, out=infinite, where=smallest > 0.0))


def is_singular(chain: Chain, q: ArrayLike) -> NDArray[np.bool_]:
    """Whether the first three joints do not determine the force at the tip, at q (..., n).  (7.26)"""
    J_v, _ = jacobian(chain, q)
    return np.asarray(condition(J_v[..., :ARM]) > SINGULAR)


def singular_slides(chain: Chain, q_pitch: float) -> Array:
    """Slides at which J_v of the first three joints is singular at this pitch, ascending (0, 1 or 2,) [m].

    det J_v is a polynomial of the second degree in q3, and the roll does not change it.  The levers of the roll about
    its axis and of the pitch about the remote centre each grow linearly with the slide.
    """
    q = np.array([[0.0, q_pitch, slide] for slide in (-1.0, 0.0, 1.0)])
    low, middle, high = np.linalg.det(jacobian(chain, q)[0])
    square, linear = (low + high) / 2.0 - middle, (high - low) / 2.0
    size = max(abs(square), abs(linear), abs(middle))
    roots = np.roots([0.0 if abs(x) < 1e-12 * size else x for x in (square, linear, middle)])
    return np.sort(roots[np.abs(roots.imag) < DOUBLE].real)


def from_efforts(J: ArrayLike, tau_ext: ArrayLike, C_tau: ArrayLike) -> tuple[Array, Array]:
    """Compute the force or wrench (..., k) of efforts (..., k) with covariance (..., k, k), and its covariance.

    Both are NaN at singular poses, where the efforts do not determine one direction.  (7.26)
    """
    J, tau_ext = np.asarray(J, float), np.asarray(tau_ext, float)
    C_tau = np.broadcast_to(np.asarray(C_tau, float), J.shape)
    w, C_w = np.full(tau_ext.shape, np.nan), np.full(J.shape, np.nan)
    regular = condition(J) <= SINGULAR
    inverse = np.linalg.inv(np.swapaxes(J[regular], -1, -2))  # J^-T
    w[regular] = np.einsum("...ij,...j->...i", inverse, tau_ext[regular])
    C_w[regular] = inverse @ C_tau[regular] @ np.swapaxes(inverse, -1, -2)
    return w, C_w


def covariance(std: ArrayLike, correlation: ArrayLike) -> Array:
    """The covariance (..., k, k) of efforts with these standard deviations (..., k) and correlations (k, k)."""
    std = np.asarray(std, float)
    return np.asarray(std[..., :, None] * np.asarray(correlation, float) * std[..., None, :])


def sigma_ellipsoid(C: ArrayLike) -> tuple[Array, Array]:
    """Half-axes (..., 3) of the sigma ellipsoid of a covariance (..., 3, 3), and their directions (..., 3, 3) in rows.

    The longest comes first.
    """
    values, vectors = np.linalg.eigh(np.asarray(C, float))
    sigma = np.sqrt(np.maximum(values[..., ::-1], 0.0))
    directions = np.swapaxes(vectors[..., ::-1], -1, -2)
    largest = np.take_along_axis(directions, np.abs(directions).argmax(-1)[..., None], -1)
    return sigma, directions * np.sign(largest)  # an axis has no sign: its largest component is taken as positive


def reach_95(f: ArrayLike, C: ArrayLike) -> Array:
    """Radius (...,) of the 95 % ellipsoid of a covariance (..., 3, 3) in the direction of a force (..., 3).

    |f| is no more than that where 0 lies in the 95 % ellipsoid about f.
    """
    f, C = np.asarray(f, float), np.asarray(C, float)
    size = np.linalg.norm(f, axis=-1)
    u = np.divide(f, size[..., None], out=np.zeros(f.shape), where=size[..., None] > 0.0)
    u[..., 0] += size == 0.0  # of no force, any direction
    squared = np.einsum("...i,...i->...", u, np.linalg.solve(C, u[..., None])[..., 0])
    return np.asarray(np.sqrt(CHI_SQUARED_95 / squared))


def lever(J: ArrayLike) -> Array:
    """Force [N] at the tip of one unit of each effort (..., k): the lengths of the columns of J^-T."""
    return np.asarray(np.linalg.norm(np.linalg.inv(np.swapaxes(np.asarray(J, float), -1, -2))[..., :3, :], axis=-2))


def shared_correlations(rho: Array) -> Array:
    """The correlations (p,) that logs (n, p) share; of fewer than two logs, none."""
    if len(rho) < 2:
        return np.zeros(rho.shape[1])
    mean, var = rho.mean(0), rho.var(0, ddof=1) / len(rho)
    squares = float(np.sum(mean**2))
    share = max(0.0, 1.0 - float(var.sum()) / squares) if squares else 0.0
    return np.asarray(share * mean)


def matrix(rho_12: float, rho_13: float, rho_23: float) -> Array:
    """The correlations of three joints as a matrix (3, 3)."""
    return np.array([[1.0, rho_12, rho_13], [rho_12, 1.0, rho_23], [rho_13, rho_23, 1.0]])
