"""Least squares among the parameters that a mechanism can have, as a conic program, which Clarabel solves.

    theta = arg min |U D theta - y|^2,    theta = A x,    J_l(x) >= 0 of every link,    x_i >= 0 where physics knows it

Sousa and Cortesao, Inertia tensor properties in robot dynamics identification: a linear matrix inequality approach,
2019.  Of the x that make the same theta the lightest is taken, so that there is one: the traces of J have a price.
Where the data ask for first moments without inertia, masses grow large, for the moment of an endless mass needs none;
a solver that runs after them is called back by a higher price.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, hstack, vstack

from davinci_forces.errors import NotIdentifiable
from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.estimation.least_squares import Triangle
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias
from davinci_forces.maths.models.model import Mechanism

TEN = 10  # inertial parameters of a link, and entries of a symmetric matrix of four rows
ENTRIES = [(i, j) for j in range(4) for i in range(j + 1)]  # of the triangle of J, in the solver's order
SECOND = [k for k, (_, j) in enumerate(ENTRIES) if j < 3]  # of them, those that are second moments of the mass
FIRST = [k for k, (i, j) in enumerate(ENTRIES) if i < j == 3]
DIAGONAL = [k for k, (i, j) in enumerate(ENTRIES) if i == j]
NEGLIGIBLE = 1e-10  # of the longest column, below which the effort does not show what it multiplies
PRICES = (1e-10, 1e-9, 1e-8, 1e-7)  # of the traces of J, where the square of the whole effort is 1
AT_BOUND = 1e-8  # of the effort, below which a bound that holds is met exactly
TOLERANCE = 1e-12  # asked of the solver
STEP = 0.9  # share of the way to the edge of a cone that it goes at a time: nearer by, rounding stops it early
GAP = 1e-8  # of the same squares, by which the best may be missed


def settings(tolerance: float) -> Any:
    """Of Clarabel: no words, one thread, nothing removed beforehand, and gaps and residuals of at most `tolerance`."""
    import clarabel

    chosen = clarabel.DefaultSettings()
    chosen.verbose = False
    chosen.max_threads = 1
    chosen.presolve_enable = False
    chosen.tol_gap_abs = chosen.tol_gap_rel = chosen.tol_feas = tolerance
    return chosen


class Made(NamedTuple):
    """Parameters that a mechanism can have, one that has them, and what that costs."""

    theta: Array  # (p,)
    x: Array  # (n,)
    excess: float  # of the squares over the least, as a share of the effort's own
    gap: float  # by which the solver may miss the best, likewise


class Cones(NamedTuple):
    """The program in unknowns z, each scaled by what the effort shows of it: x = B z."""

    scale: csc_array  # B (n, n)
    seen: Integers  # the unknowns that the effort shows at all, links first
    links: int  # that it shows
    positive: Integers  # of those seen, numbers without a link that are not negative


def nearest(R: Triangle, mechanism: Mechanism) -> Made:
    """The best parameters that a mechanism can have; those of least squares, to the bit, where signs are all there is.

    Raises
    ------
    NotIdentifiable
        If the solver does not get there.
    """
    if not mechanism.has_bodies and (R.theta[mechanism.positive] >= 0).all():
        return Made(R.theta, R.theta, 0.0, 0.0)
    F, size = (R.U * R.scale) @ mechanism.matrix, float(np.sqrt(R.y @ R.y + R.squares))
    cones = scaled(F, mechanism)
    z, gap = solved(csc_array(F @ cones.scale)[:, cones.seen], R.y / size, cones)
    x = np.asarray(cones.scale[:, cones.seen] @ z * size)
    theta = np.asarray(mechanism.matrix @ x)
    return Made(theta, x, float(R.excess(theta)) / size**2, gap)


def scaled(F: Array, mechanism: Mechanism) -> Cones:
    """Unknowns whose columns of F (p, n) are about of unit length.

    Scaling the axes of a link and its mass, J = T Z T', T = diag(s, s, s, t), leaves its cone as it is.
    """
    L, n = mechanism.links, F.shape[1]
    to_ten, B = parameters_of_entries(), np.zeros((n, n))
    longest = float(np.linalg.norm(F, axis=0).max())
    seen = list[int]()
    for link in range(L):
        own = slice(TEN * link, TEN * (link + 1))
        columns = F[:, own] @ to_ten
        if (size := np.linalg.norm(columns, axis=0)).max() > NEGLIGIBLE * longest:
            B[own, own] = to_ten * scales_of_entries(size, NEGLIGIBLE * longest)
            seen += range(own.start, own.stop)
    rest = np.arange(TEN * L, n)
    size = np.linalg.norm(F[:, rest], axis=0)
    rest, size = rest[size > NEGLIGIBLE * longest], size[size > NEGLIGIBLE * longest]
    B[rest, rest] = 1.0 / size
    which = np.array([*seen, *rest.tolist()])
    links = len(seen) // TEN
    held = np.flatnonzero(mechanism.positive[which] & (np.arange(len(which)) >= TEN * links))
    return Cones(csc_array(B), which, links, held)


def parameters_of_entries() -> Array:
    """The inertial parameters (10, 10) of each entry of J, as the solver takes a symmetric matrix."""
    J = np.zeros((TEN, 4, 4))
    for k, (i, j) in enumerate(ENTRIES):
        J[k, i, j] = J[k, j, i] = 1.0 if i == j else np.sqrt(0.5)
    return of_pseudo_inertias(J).T


def scales_of_entries(size: Array, least: float) -> Array:
    """T J T' by entry (10,), given how long their columns (10,) are: what is not seen follows from what is."""
    second, first, mass = (float(size[which].max()) for which in (SECOND, FIRST, [TEN - 1]))
    if max(second, mass) <= least:
        second = mass = first
    elif second <= least:
        second = max(first**2 / mass, least)
    elif mass <= least:
        mass = max(first**2 / second, least)
    T = np.sqrt([1.0 / second] * 3 + [1.0 / mass])
    return np.array([T[i] * T[j] for i, j in ENTRIES])


def solved(F: csc_array, y: Array, cones: Cones) -> tuple[Array, float]:
    """z of the least |F z - y|^2 in its cones, at the lowest price at which the solver gets there, and the gap left.

    Raises
    ------
    NotIdentifiable
        If it does at none.
    """
    for price in PRICES:
        z, gap, said = at_price(F, y, cones, price)
        if gap <= GAP:
            return z, gap
    raise NotIdentifiable(
        f"the conic program was not solved ({said}): its answer may miss the best by {gap:.1e} of the effort's square"
    )


def at_price(F: csc_array, y: Array, cones: Cones, price: float) -> tuple[Array, float, str]:
    """z of the least |F z - y|^2 + price of the traces, by how much it may miss that, and what the solver says.

    The residual r = F z - y is an unknown of its own, so that no product of F with itself is made.
    """
    import clarabel

    p, n = F.shape
    held = np.concatenate([np.arange(TEN * cones.links), cones.positive])
    cost = np.zeros(n + p)
    cost[[TEN * link + k for link in range(cones.links) for k in DIAGONAL]] = price
    squares = diags_array(np.r_[np.zeros(n), np.full(p, 2.0)], format="csc")
    in_cones = hstack([-eye_array(n, format="csr")[held], csc_array((len(held), p))])
    rows = vstack([hstack([F, -eye_array(p)]), in_cones], format="csc")
    kinds: list[Any] = [clarabel.ZeroConeT(p), *[clarabel.PSDTriangleConeT(4)] * cones.links]
    kinds += [clarabel.NonnegativeConeT(len(cones.positive))] if len(cones.positive) else []
    bound = np.r_[y, np.zeros(len(held))]
    answer = clarabel.DefaultSolver(squares, cost, rows, bound, kinds, careful()).solve()
    z = np.array(answer.x)[:n]
    z[held] = np.array(answer.s)[p:]  # which lies in the cones, and not just beside them
    own, multiplier = z[cones.positive], np.array(answer.z)[p + TEN * cones.links :]
    z[cones.positive] = np.where((own < AT_BOUND) & (own < multiplier), 0.0, own)  # of the two one is 0
    gap = float(((F @ z - y) ** 2).sum() + cost[:n] @ z) - float(answer.obj_val_dual)  # no z is below the dual's value
    return z, gap if np.isfinite(gap) else np.inf, f"{answer.status} after {answer.iterations} steps"


def careful() -> Any:
    """The solver's settings, with small steps."""
    cautious = settings(TOLERANCE)
    cautious.max_step_fraction = STEP
    return cautious
