"""Cross-validation of models: least squares with parts of the path left out, and the choice among the candidates.

Parts of a path are left out one at a time, so that neither a predicted sample nor its neighbours are in the fit.  If
a period is left out, the others repeat its path, so every column improves the prediction.  If a block of the path is
left out, no other part repeats it.

The fit is regularised by a ridge on columns scaled to the same size.

    theta = arg min sum_i w_i |tau_i - Phi_i theta|^2 + lambda theta' P theta

The penalty of base parameters beta = K pi is that of the smallest pi that gives beta, with each entry scaled by its
column.  So the penalty does not depend on which parameters lead the combinations:

    P = (K D^-1 K')^-1,    D = diag(K' G K)

Normal equations are summed by cells of the data, so that a fit without some of the cells needs no samples:

    G = sum Phi' Phi,    r = sum Phi' tau,    s = sum tau^2,    |tau - Phi theta|^2 = s - 2 r' theta + theta' G theta
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers

UNSEEN = 1e-12  # a column with a smaller share of the largest square is only rounding
ROUNDING_OF_COLUMN = 1e-12  # a column with a smaller share of the largest length is only rounding
DEPENDENT = 1e12  # condition number above which equations of scaled columns are dependent; it is the columns' squared
PATH_BLOCKS = 6  # a period, or a recording that does not repeat, is divided into this number of blocks
MAX_GROUPS = 20  # largest number of groups that are left out in turn, each with a separate fit
CLEARLY = 1.0  # a candidate is clearly worse by more than this many standard errors of the difference


class Equations(NamedTuple):
    """Normal equations of m efforts in C cells."""

    gram: Array  # (C, m, p, p)
    right: Array  # (C, m, p)
    squares: Array  # (C, m)

    def sum_groups(self, groups: Iterable[Booleans]) -> "Equations":
        """Sum the equations of the cells (C,) of each of G groups, as G cells."""
        cells = list(groups)
        return Equations(*(np.stack([part[group].sum(axis=0) for group in cells]) for part in self))

    def errors(self, theta: Array) -> Array:
        """Squared errors |tau - Phi theta|^2 (C, m) of parameters (p,), or of those of each cell (C, p)."""
        product = np.einsum("...mpq,...p,...q->...m", self.gram, theta, theta)
        return np.asarray(np.maximum(self.squares - 2.0 * (self.right @ theta[..., None])[..., 0] + product, 0.0))

    def columns(self, which: Sequence[int] | Integers) -> "Equations":
        """The equations of some of the parameters."""
        index = np.asarray(which, np.int64)
        return Equations(self.gram[:, :, index][..., index], self.right[..., index], self.squares)


def sum_equations(Phi: Array, tau: Array, cell: Integers, cells: int) -> Equations:
    """Sum the equations of Phi (N, m, p) and tau (N, m) by cell (N,); cell -1 and efforts that are NaN are left out."""
    m, p = Phi.shape[1:]
    equations = Equations(np.zeros((cells, m, p, p)), np.zeros((cells, m, p)), np.zeros((cells, m)))
    for c in np.unique(cell[cell >= 0]).tolist():
        rows = cell == c
        for i in range(m):
            valid = rows & ~np.isnan(tau[:, i])
            if valid.any():
                F, z = Phi[valid, i], tau[valid, i]
                equations.gram[c, i], equations.right[c, i], equations.squares[c, i] = F.T @ F, F.T @ z, z @ z
    return equations


def sum_all(cells: Equations) -> Equations:
    """Sum the equations of all cells."""
    return cells.sum_groups([np.ones(len(cells.gram), np.bool_)])


def side_by_side(parts: Sequence[Equations], places: Sequence[int], count: int) -> Equations:
    """Join equations of equally many cells into `count` parts, each at its place; all other parts are 0."""
    joined = Equations(*(np.zeros((count, *column.shape)) for column in parts[0]))
    for place, part in zip(places, parts, strict=True):
        for whole, column in zip(joined, part, strict=True):
            whole[place] = column
    return Equations(*(column.reshape(-1, *column.shape[2:]) for column in joined))


class Ridge(NamedTuple):
    """Regularisation and weights of the normal equations."""

    strength: float  # lambda [-]
    weights: Array  # w (m,) of the efforts
    combination: Array  # K (b, 10 L + ...) of the first b parameters; each other parameter is no combination


def solve(equations: Equations, ridge: Ridge) -> Array:
    """Solve one cell for its parameters (p,); raises LinAlgError if columns are linearly dependent without a ridge."""
    return np.asarray(solve_each(equations, ridge)[0])


def solve_each(equations: Equations, ridge: Ridge) -> Array:
    """Solve the equations of each cell for its parameters (C, p); raises as `solve` does."""
    scaled, size = scaled_equations(equations, ridge)
    right = ridge.weights @ equations.right / size
    return np.asarray(np.linalg.solve(scaled, right[..., None])[..., 0] / size)


def scaled_equations(equations: Equations, ridge: Ridge) -> tuple[Array, Array]:
    """G + lambda P (C, p, p) of columns scaled to unit length, and their lengths (C, p); raises as `solve` does."""
    G = np.einsum("m,cmpq->cpq", ridge.weights, equations.gram)
    size = np.sqrt(np.einsum("cpp->cp", G))
    # After scaling, a column of rounding errors would look like any other column to the ridge.  If a joint stands
    # still, some base parameters of an arm have a column of zeros, which does not affect the others.
    least = 0.0 if len(ridge.combination) else ROUNDING_OF_COLUMN * size.max(axis=1, keepdims=True)
    if not (size > least).all():
        raise np.linalg.LinAlgError("a column is zero throughout")
    scaled = (G + ridge.strength * penalty(G, ridge.combination)) / size[:, None] / size[:, :, None]
    if ridge.strength == 0.0 and (np.linalg.cond(scaled) > DEPENDENT).any():
        raise np.linalg.LinAlgError("the columns are linearly dependent")
    return scaled, size


def covariance(equations: Equations, ridge: Ridge, variances: Array) -> Array:
    """Covariance (p, p) by noise of variances (m,) in the efforts; raises LinAlgError if rounding makes it negative."""
    [scaled], [size] = scaled_equations(equations, ridge)
    inverse = np.linalg.inv(scaled) / size / size[:, None]
    result = np.asarray(inverse @ np.einsum("m,mpq->pq", ridge.weights**2 * variances, equations.gram[0]) @ inverse)
    if np.diag(result).min() < 0.0:
        raise np.linalg.LinAlgError("the columns are linearly dependent but for rounding")
    return result


def penalty(G: Array, combination: Array) -> Array:
    """Penalty P (C, p, p): the square of each parameter's column; for base parameters, that of the smallest pi."""
    P, b = np.where(np.eye(G.shape[-1], dtype=np.bool_), G, 0.0), len(combination)
    if b:
        D = size_of_links(G, combination)
        share = np.divide(1.0, D, out=np.zeros_like(D), where=UNSEEN * D.max(axis=1, keepdims=True) < D)
        P[:, :b, :b] = np.linalg.inv((combination * share[:, None]) @ combination.T)
    return P


def size_of_links(G: Array, combination: Array) -> Array:
    """Squared lengths D (C, 10 L + ...) of the columns of the parameters pi that base parameters combine."""
    b = len(combination)
    return np.asarray(((G[:, :b, :b] @ combination) * combination).sum(axis=1))


def excited_parameters(equations: Equations, ridge: Ridge) -> int:
    """The number of base parameters that the data of one cell excite; without them the penalty does not exist."""
    if not len(ridge.combination):
        return 0
    [D] = size_of_links(np.einsum("m,cmpq->cpq", ridge.weights, equations.gram), ridge.combination)
    return int(np.linalg.matrix_rank(ridge.combination[:, UNSEEN * D.max() < D]))


def path_blocks(t: Array, period: float, moving: Booleans | None = None) -> Integers:
    """The block of the path, 0 to 5, of each sample (N,) at times `t` [s]: a sixth of its period or of the recording.

    A `period` of 0 [s] stands for a recording that does not repeat.  Its blocks are sixths of the time in which it is
    `moving` (N,), or of all its time without that mask.
    """
    elapsed = t - t[0]
    if moving is not None and not moving.all() and not period:
        elapsed = np.concatenate([[0.0], np.cumsum(np.diff(t) * moving[1:])])
    length = period or float(elapsed[-1]) * (1 + 1e-9) or 1.0
    return np.asarray((elapsed / length % 1.0 * PATH_BLOCKS).astype(np.int64) % PATH_BLOCKS)


def schemes_of(squares: Array, together: Sequence[int]) -> list[Booleans]:
    """Schemes (G, C) of the cells that each of G refits leaves out; a cell is a block of a log.

    The schemes leave out sixths of the path, its halves, and each of several logs: at most `MAX_GROUPS` groups in all.
    Each refit needs data of every effort, of squares (C, m) in all cells.  It also needs a log that moves as many
    joints together as any, of which `together` (L,) has the numbers: without one, coupling cannot be estimated.
    """
    count = len(together)
    log, block = np.repeat(np.arange(count), PATH_BLOCKS), np.tile(np.arange(PATH_BLOCKS), count)
    parts = min(MAX_GROUPS - PATH_BLOCKS - 2, count)
    sixths = block == np.arange(PATH_BLOCKS)[:, None]
    halves = block // (PATH_BLOCKS // 2) == np.arange(2)[:, None]
    by_log = log * parts // count == np.arange(parts)[:, None]
    widest = np.repeat(together, PATH_BLOCKS) == max(together)
    is_coupled = count > 1 and all(widest[~group].any() for group in by_log)
    schemes = [sixths, halves, by_log] if is_coupled else [sixths, halves]
    return [groups for groups in schemes if all((squares[~group].sum(axis=0) > 0).all() for group in groups)]


class CrossValidation(NamedTuple):
    """Relative squared errors of a candidate on the data that its fits left out, by scheme."""

    unseen: tuple[Array, ...]  # of each scheme (G, m): squared error of a group over the effort's square in all groups
    fitted: tuple[Array, ...]  # likewise of the fit to all data

    @property
    def errors(self) -> Array:
        """Relative error (m,) of each effort, the mean over schemes."""
        return np.asarray(np.mean([np.sqrt(shares.sum(axis=0)) for shares in self.unseen], axis=0))

    @property
    def score(self) -> float:
        """The mean of the relative errors."""
        return float(self.errors.mean())

    @property
    def fit(self) -> "CrossValidation":
        """The errors of the fit to all data, as if no group had been left out."""
        return CrossValidation(self.fitted, self.fitted)


class LeftOut:
    """The equations of cells without each group of every scheme (G, C), and of the group, for candidates to refit.

    The parameters solve `equations`.  The errors are those of `scored`, where candidates of other low-passes share one.
    """

    def __init__(self, equations: Equations, schemes: Sequence[Booleans], scored: Equations | None = None) -> None:
        self.all, scored = sum_all(equations), scored or equations
        self.squares = scored.squares.sum(axis=0)
        self.schemes = [(equations.sum_groups(~groups), scored.sum_groups(groups)) for groups in schemes]

    def cross_validate(self, ridge: Ridge) -> CrossValidation:
        """Leave out each group of cells in turn, and predict it; raises as `solve` does for the other cells."""
        unseen, fitted, of_all = [], [], solve(self.all, ridge)
        for training, groups in self.schemes:
            unseen.append(groups.errors(solve_each(training, ridge)) / self.squares)
            fitted.append(groups.errors(of_all) / self.squares)
        return CrossValidation(tuple(unseen), tuple(fitted))


def combine_efforts(parts: Sequence[CrossValidation]) -> CrossValidation:
    """Combine the fits to different efforts into one candidate."""
    columns = zip(*parts, strict=True)
    return CrossValidation(*(tuple(np.concatenate(s, axis=1) for s in zip(*c, strict=True)) for c in columns))


def standard_error(candidate: CrossValidation, reference: CrossValidation | None = None) -> float:
    """Standard error of a score, or of the difference of two scores, by the jackknife over groups."""
    variances = []
    for i, shares in enumerate(candidate.unseen):
        G = len(shares)
        others = (1.0 - np.eye(G)) * G / (G - 1)
        scores = np.sqrt(others @ shares).mean(axis=1)
        if reference:
            scores -= np.sqrt(others @ reference.unseen[i]).mean(axis=1)
        variances.append((G - 1) * scores.var())
    return float(np.sqrt(np.mean(variances)))


def choose_candidate(
    candidates: Sequence[CrossValidation], ranks: Sequence[int], eligible: Sequence[bool]
) -> tuple[int, int]:
    """Indices of the chosen candidate and of the best.

    The chosen one has the lowest rank, such as the number of parameters, that has a candidate not clearly worse than
    the best.  Of that rank it is the one with the least error, even if that is surely more than the best's.

    Raises ValueError if no candidate is eligible.
    """
    scores = {i: candidates[i].score for i, good in enumerate(eligible) if good}
    best = min(scores, key=scores.__getitem__)
    bounds = {i: scores[best] + CLEARLY * standard_error(candidates[i], candidates[best]) for i in scores}
    lowest = min(ranks[i] for i in scores if scores[i] <= bounds[i])
    return min((i for i in scores if ranks[i] == lowest), key=scores.__getitem__), best
