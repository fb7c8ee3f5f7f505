"""Where the tip can go, and how well efforts at the joints tell the force there.

tau_ext = J_v' f                                                                          (7.25), (7.26)
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import jacobian

# Above this condition number a pose counts as singular: the first three joints leave one direction of the force
# undetermined in practice.  It is 0.1 mm from an exact singularity; in the box of Table 6.2 it reaches 60.
SINGULAR = 1e4
# Above this one a force is marked: one direction of it is a hundred times less well told than another, as where the
# lever of a joint at the tip is about a centimetre.  The box of Table 6.2 stays below.
NEAR_SINGULAR = 1e2
DOUBLE = 1e-6  # [m] imaginary part that rounding, at its square root, gives to a double root
ARM = 3  # coordinates of the reduced Jacobian


def condition(J_v: ArrayLike) -> Array:
    """The condition number (...) of J_v (..., 3, n): how much a force can be blurred more than another.

    It mixes metres per radian and metres per metre, as the Jacobian itself does.
    """
    values = np.linalg.svd(np.asarray(J_v, float), compute_uv=False)
    smallest = values[..., -1]
    infinite = np.full(smallest.shape, np.inf)
    return np.asarray(np.divide(values[..., 0], smallest, out=infinite, where=smallest > 0.0))


def is_singular(chain: Chain, q: ArrayLike) -> NDArray[np.bool_]:
    """Whether the first three joints cannot tell the force at the tip, at q (..., n).  (7.26)"""
    J_v, _ = jacobian(chain, q)
    return np.asarray(condition(J_v[..., :ARM]) > SINGULAR)


def singular_slides(chain: Chain, q_pitch: float) -> Array:
    """Where the slide makes J_v of the first three joints singular at this pitch, ascending (0, 1 or 2,) [m].

    det J_v is a polynomial of the second degree in q3, and the roll does not change it: two levers, that of the roll
    about its axis and that of the pitch about the remote centre, each grow linearly with the slide.
    """
    q = np.array([[0.0, q_pitch, slide] for slide in (-1.0, 0.0, 1.0)])
    low, middle, high = np.linalg.det(jacobian(chain, q)[0])
    square, linear = (low + high) / 2.0 - middle, (high - low) / 2.0
    size = max(abs(square), abs(linear), abs(middle))
    roots = np.roots([0.0 if abs(x) < 1e-12 * size else x for x in (square, linear, middle)])
    return np.sort(roots[np.abs(roots.imag) < DOUBLE].real)
