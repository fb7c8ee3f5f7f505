"""Least squares over the physically possible parameters of a mechanism, as a conic program solved by Clarabel.

    theta = arg min |U D theta - y|^2,    theta = A x,    J_l(x) >= 0 of every link,    x_i >= 0 if required

Sousa and Cortesao, Inertia tensor properties in robot dynamics identification: a linear matrix inequality approach,
2019.  Many x give the same theta: a small price on the traces of J selects the lightest.  If the data demand first
moments without inertia, masses grow without limit; a higher price limits them, so that the solver stops.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csc_array, diags_array, eye_array, hstack, vstack

from davinci_forces.errors import NotIdentifiable
from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.estimation.least_squares import Triangle
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias, pseudo_inertias
from davinci_forces.maths.models.model import Mechanism

TEN = 10  # number of inertial parameters of a link, and of entries of a symmetric 4 x 4 matrix
ENTRIES = [(i, j) for j in range(4) for i in range(j + 1)]  # entries of the triangle of J, in the solver's order
SECOND = [k for k, (_, j) in enumerate(ENTRIES) if j < 3]  # positions in `ENTRIES` of the second moments
FIRST = [k for k, (i, j) in enumerate(ENTRIES) if i < j == 3]  # positions of the first moments
DIAGONAL = [k for k, (i, j) in enumerate(ENTRIES) if i == j]
NEGLIGIBLE_COLUMN = 1e-10  # a parameter has no effect on the effort if its column has a smaller share of the longest
PRICES = (1e-10, 1e-9, 1e-8, 1e-7)  # weights of the traces of J, with the square of the whole effort scaled to 1
AT_BOUND = 1e-8  # a value nearer to its bound than this share of the effort is set to the bound
TOLERANCE = 1e-12  # of the solver's gaps and residuals
MAX_STEP_FRACTION = 0.9  # a longer step towards the edge of a cone lets rounding stop the solver early
MAX_GAP_SOLVER = 1e-8  # duality gap, as a share of the effort's square
MAX_MISS = 0.01  # of a parameter by the mechanism that has it, in standard errors
MIN_THICKNESS = 1e-9  # smallest eigenvalue of J over its largest: simulators refuse a body without any inertia
LENGTH = 0.1  # [m] size of the links of an arm for surgery, which compares moments of inertia with masses


def settings(tolerance: float) -> Any:
    """Settings of Clarabel: silent, one thread, careful steps, and gaps and residuals of at most `tolerance`."""
    import clarabel

    chosen = clarabel.DefaultSettings()
    chosen.verbose = False
    chosen.max_threads = 1
    chosen.presolve_enable = False
    chosen.max_step_fraction = MAX_STEP_FRACTION
    chosen.tol_gap_abs = chosen.tol_gap_rel = chosen.tol_feas = tolerance
    return chosen


class ConsistentParameters(NamedTuple):
    """Physically possible parameters, a mechanism that has them, and their excess over least squares."""

    theta: Array  # (p,)
    x: Array  # (n,)
    excess: float  # of the squared residuals over their minimum, as a share of the effort's square


class Cones(NamedTuple):
    """The program in unknowns z, each scaled by its effect on the effort: x = B z."""

    scale: csc_array  # B (n, n)
    seen: Integers  # the unknowns with an effect on the effort, links first
    links: int  # number of links with an effect
    positive: Integers  # places in `seen` of the unknowns outside links that must not be negative


def nearest(R: Triangle, mechanism: Mechanism) -> ConsistentParameters:
    """Find the best physically possible parameters; raises NotIdentifiable if the solver does not converge.

    For a mechanism without bodies, the parameters of least squares are returned if their signs are possible.
    """
    if not mechanism.links and (R.theta[mechanism.positive] >= 0).all():
        return ConsistentParameters(R.theta, R.theta, 0.0)
    F, size = (R.U * R.scale) @ mechanism.matrix, float(np.sqrt(R.y @ R.y + R.min_squares))
    cones = scale_unknowns(F, mechanism)
    z = solve(csc_array(F @ cones.scale)[:, cones.seen], R.y / size, cones)
    x = np.asarray(cones.scale[:, cones.seen] @ z * size)
    theta = np.asarray(mechanism.matrix @ x)
    return ConsistentParameters(theta, x, float(R.excess(theta)) / size**2)


def scale_unknowns(F: Array, mechanism: Mechanism) -> Cones:
    """Scale the unknowns so that their columns of F (p, n) have about unit length.

    Scaling the axes of a link and its mass, J = T Z T', T = diag(s, s, s, t), does not change its cone.
    """
    L, n = mechanism.links, F.shape[1]
    to_ten, B = parameters_of_entries(), np.zeros((n, n))
    size = np.linalg.norm(F, axis=0)
    least, excited = NEGLIGIBLE_COLUMN * float(size.max()), list[int]()
    for link in range(L):
        span = slice(TEN * link, TEN * (link + 1))
        lengths = np.linalg.norm(F[:, span] @ to_ten, axis=0)
        if lengths.max() > least:
            B[span, span] = to_ten * scales_of_entries(lengths, least)
            excited += range(span.start, span.stop)
    others = TEN * L + np.flatnonzero(size[TEN * L :] > least)
    B[others, others] = 1.0 / size[others]
    seen = np.array([*excited, *others.tolist()])
    bounded = np.flatnonzero(mechanism.positive[seen] & (seen >= TEN * L))
    return Cones(csc_array(B), seen, len(excited) // TEN, bounded)


def parameters_of_entries() -> Array:
    """Inertial parameters (10, 10) of each entry of J, in the solver's form of a symmetric matrix."""
    J = np.zeros((TEN, 4, 4))
    for k, (i, j) in enumerate(ENTRIES):
        J[k, i, j] = J[k, j, i] = 1.0 if i == j else np.sqrt(0.5)
    return of_pseudo_inertias(J).T


def scales_of_entries(size: Array, least: float) -> Array:
    """Scales (10,) of the entries of T J T' by the lengths (10,) of their columns; a short column uses the others."""
    second, first, mass = (float(size[entries].max()) for entries in (SECOND, FIRST, [TEN - 1]))
    if max(second, mass) <= least:
        second = mass = first
    elif second <= least:
        second = max(first**2 / mass, least)
    elif mass <= least:
        mass = max(first**2 / second, least)
    T = np.sqrt([1.0 / second] * 3 + [1.0 / mass])
    return np.array([T[i] * T[j] for i, j in ENTRIES])


def solve(F: csc_array, y: Array, cones: Cones) -> Array:
    """Minimise |F z - y|^2 in the cones at the lowest price that converges; raises NotIdentifiable if none does."""
    for price in PRICES:
        z, gap, status = solve_at_price(F, y, cones, price)
        if gap <= MAX_GAP_SOLVER:
            return z
    raise NotIdentifiable(
        f"the conic program was not solved ({status}): it may miss the optimum by {gap:.1e} of the effort's square"
    )


def solve_at_price(F: csc_array, y: Array, cones: Cones, price: float) -> tuple[Array, float, str]:
    """Minimise |F z - y|^2 + price * traces in the cones; return z, the gap, and the solver's status."""
    import clarabel

    p, n = F.shape
    bounded = np.concatenate([np.arange(TEN * cones.links), cones.positive])
    cost = np.zeros(n + p)
    cost[[TEN * link + k for link in range(cones.links) for k in DIAGONAL]] = price
    squares = diags_array(np.r_[np.zeros(n), np.full(p, 2.0)], format="csc")
    in_cones = hstack([-eye_array(n, format="csr")[bounded], csc_array((len(bounded), p))])
    # The residual r = F z - y is a separate unknown, so that the solver never forms F' F.
    rows = vstack([hstack([F, -eye_array(p)]), in_cones], format="csc")
    kinds: list[Any] = [clarabel.ZeroConeT(p), *[clarabel.PSDTriangleConeT(4)] * cones.links]
    kinds += [clarabel.NonnegativeConeT(len(cones.positive))] if len(cones.positive) else []
    bound = np.r_[y, np.zeros(len(bounded))]
    answer = clarabel.DefaultSolver(squares, cost, rows, bound, kinds, settings(TOLERANCE)).solve()
    z = np.array(answer.x)[:n]
    z[bounded] = np.array(answer.s)[p:]  # the slack lies exactly in the cones
    values, multiplier = z[cones.positive], np.array(answer.z)[p + TEN * cones.links :]
    z[cones.positive] = np.where((values < AT_BOUND) & (values < multiplier), 0.0, values)  # one of the two is 0
    gap = float(((F @ z - y) ** 2).sum() + cost[:n] @ z) - float(answer.obj_val_dual)  # the dual is a lower bound
    return z, gap if np.isfinite(gap) else np.inf, f"{answer.status} after {answer.iterations} steps"


def complete(theta: Array, std: Array, mechanism: Mechanism, price: Array, guess: Array | None) -> Array:
    """Find a mechanism x (n,) with these parameters (p,): nearest to guessed links (10 L,), or of the least mass.

    minimise |z - z_guess|^2, or the traces of all J, plus |price x|^2 of what is not a link,    A x = theta

    z are the entries of every J in kg and `LENGTH`; `price` (n - 10 L,) makes x comparable with them.

    Raises NotIdentifiable if a parameter is missed by more than `MAX_MISS` of its standard error `std`, if it has one.
    """
    import clarabel

    L, n = mechanism.links, mechanism.matrix.shape[1]
    links, scale = np.arange(n) < TEN * L, np.array([LENGTH] * 3 + [1.0])
    B = block_diag(*[parameters_of_entries() * [scale[i] * scale[j] for i, j in ENTRIES]] * L, np.diag(1.0 / price))
    F = mechanism.matrix @ B
    size = np.linalg.norm(F, axis=1)
    z_guess = np.zeros(n) if guess is None else np.linalg.solve(B, np.r_[guess, 0.0 * price])
    trace = links & np.isin(np.arange(n) % TEN, DIAGONAL)
    bounded = np.r_[: TEN * L, np.flatnonzero(mechanism.positive & ~links)]
    rows = csc_array(np.vstack([F / size[:, None], -np.eye(n)[bounded]]))
    signs = clarabel.NonnegativeConeT(len(bounded) - TEN * L)
    kinds = [clarabel.ZeroConeT(len(F)), *[clarabel.PSDTriangleConeT(4)] * L, signs]
    squares = diags_array(2.0 * (~links | (guess is not None)), format="csc")
    cost, right = trace * 1.0 if guess is None else -2.0 * z_guess, np.r_[theta / size, np.zeros(len(bounded))]
    z = np.array(clarabel.DefaultSolver(squares, cost, rows, right, kinds, settings(TOLERANCE)).solve().x)
    allowed = np.fmax(MAX_GAP_SOLVER * np.abs(theta).max(), MAX_MISS * std)
    miss = float((np.abs(F @ z - theta) / allowed).max())
    if not miss <= 1.0:
        why = f"no links were found that have these parameters: the largest miss is {miss:.1e} of what is allowed"
        raise NotIdentifiable(f"{why}; make joints that no log moves `fixed` in the robot's URDF, or move them")
    x = B @ np.where(mechanism.positive & ~links, np.maximum(z, 0.0), z)
    J = pseudo_inertias(x[links].reshape(L, TEN)) / np.outer(scale, scale)
    values, V = np.linalg.eigh(J)  # bodies at the edge of what is possible, or by the solver's errors beyond it
    values = np.maximum(values, MIN_THICKNESS * values[:, -1:])
    J = (V * values[:, None]) @ V.swapaxes(1, 2) * np.outer(scale, scale)
    return np.concatenate([of_pseudo_inertias(J).ravel(), x[~links]])
