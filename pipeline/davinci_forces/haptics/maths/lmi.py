"""The common quadratic Lyapunov function as a linear matrix inequality, solved by Clarabel.  (8.8)-(8.10)

    largest t:  P >= t I,  -(A_i' P + P A_i) >= t beta I for both modes,  trace P = 1

A function exists if t > 0.  With P = [[p, r], [r, 1 - p]] there are three unknowns (p, r, t).  Time and position are
scaled by the mean stiffness of both modes, which changes no result.  A mode is then [[0, 1], [-k, -beta]] with numbers
near 1 for any hand.
"""

import numpy as np
from scipy.sparse import csc_array

from davinci_forces.haptics.maths.bimodal import Hand
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation import conic

EXISTS = 1e-7  # least t of an existing function; above the solver's tolerance
TOLERANCE = 1e-9
ROOT_2 = float(np.sqrt(2.0))  # factor of the off-diagonal entry in the solver's form of a symmetric matrix
LMI_HALVINGS = 24


def cqlf_exists(hand: Hand, k_t: float) -> bool:
    """Test whether a common quadratic Lyapunov function exists with tissue of stiffness k_t [N/m]."""
    import clarabel

    settings, cones = conic.settings(TOLERANCE), [clarabel.PSDTriangleConeT(2)] * 3
    cost, quadratic = np.array([0.0, 0.0, -1.0]), csc_array((3, 3))
    solution = clarabel.DefaultSolver(quadratic, cost, *inequality(hand, k_t), cones, settings).solve()
    return bool(solution.x[2] > EXISTS)


def inequality(hand: Hand, k_t: float) -> tuple[csc_array, Array]:
    """A (9, 3) and bound (9,), with bound - A (p, r, t)' in three cones of positive semidefinite matrices."""
    mean = hand.k + 0.5 * k_t
    beta = hand.b / float(np.sqrt(hand.m * mean))
    stiff, soft = (hand.k + k_t) / mean, hand.k / mean
    rows, bound = [[-1.0, 0.0, 1.0], [0.0, -ROOT_2, 0.0], [1.0, 0.0, 1.0]], [0.0, 0.0, 1.0]  # of P
    for k in (stiff, soft):
        rows += [[0.0, -2.0 * k / beta, 1.0], [ROOT_2 * (1.0 + k) / beta, -ROOT_2, 0.0], [2.0, 2.0 / beta, 1.0]]
        bound += [0.0, ROOT_2 * k / beta, 2.0]
    return csc_array(np.array(rows)), np.array(bound)


def lmi_limit(hand: Hand, high: float) -> float:
    """The largest K_T [N/m] below `high` for which the solver finds a function, by bisection."""
    low = 0.0
    for _ in range(LMI_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if cqlf_exists(hand, middle) else (low, middle)
    return low
