"""Choosing a model: least squares with parts of the path left out, and which of the candidates to trust.

Parts of a path are left out one at a time: what is predicted there has not been seen, nor anything near it.  Leaving a
period out repeats the path in what is kept, and rewards every column; a block of path does not.

Least squares is told how far to trust the data: a ridge on columns scaled to the same size.

    theta = arg min sum_i w_i |tau_i - Phi_i theta|^2 + lambda theta' P theta

Base parameters beta = K pi are the least of what they can be: their penalty is that of the smallest pi, each scaled by
its column, so that it does not depend on which parameters lead the combinations:

    P = (K D^-1 K')^-1,    D = diag(K' G K)

Normal equations by cells of the data, so that any part of them can be left out of a fit without going back to it.

G = sum Phi' Phi,    r = sum Phi' tau,    s = sum tau^2,    |tau - Phi theta|^2 = s - 2 r' theta + theta' G theta
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers

UNSEEN = 1e-12  # of the largest column's square, below which a column is nothing but rounding
ROUNDING = 1e-12  # of the largest column, below which rounding is all that there is of one
DEPENDENT = 1e12  # condition of the equations of scaled columns, the square of the columns' own
BLOCKS = 6  # of a period, or of a recording that does not repeat
MOST = 20  # groups at most that are left out, one refit each
CLEARLY = 1.0  # standard errors of the difference by which a candidate has to be worse


class Equations(NamedTuple):
    """What least squares needs of m efforts in C cells."""

    gram: Array  # (C, m, p, p)
    right: Array  # (C, m, p)
    squares: Array  # (C, m)

    def without(self, cells: Booleans) -> "Equations":
        """Those of all other cells (C,), as one."""
        return self.of(~cells)

    def of(self, cells: Booleans) -> "Equations":
        """Those of some cells (C,), as one."""
        return Equations(*(part[cells].sum(axis=0, keepdims=True) for part in self))

    def errors(self, theta: Array) -> Array:
        """|tau - Phi theta|^2 (C, m) of parameters (p,)."""
        product = np.einsum("cmpq,p,q->cm", self.gram, theta, theta)
        return np.asarray(np.maximum(self.squares - 2.0 * self.right @ theta + product, 0.0))

    def columns(self, which: Sequence[int] | Integers) -> "Equations":
        """Those of some of the parameters."""
        index = np.asarray(which, np.int64)
        return Equations(self.gram[:, :, index][..., index], self.right[..., index], self.squares)


def gathered(Phi: Array, tau: Array, cell: Integers, cells: int) -> Equations:
    """The equations of Phi (N, m, p) and tau (N, m), the rows of which are in cells (N,); rows in cell -1 are left out.

    An effort counts nothing where it is NaN.
    """
    m, p = Phi.shape[1:]
    made = Equations(np.zeros((cells, m, p, p)), np.zeros((cells, m, p)), np.zeros((cells, m)))
    for c in np.unique(cell[cell >= 0]).tolist():
        rows = cell == c
        for i in range(m):
            told = rows & ~np.isnan(tau[:, i])
            if told.any():
                F, z = Phi[told, i], tau[told, i]
                made.gram[c, i], made.right[c, i], made.squares[c, i] = F.T @ F, F.T @ z, z @ z
    return made


def side_by_side(parts: Sequence[Equations], places: Sequence[int], count: int) -> Equations:
    """Equations of as many cells each as `count` such parts of as many cells, each in its place; other cells hold 0."""
    made = Equations(*(np.zeros((count, *column.shape)) for column in parts[0]))
    for place, part in zip(places, parts, strict=True):
        for whole, column in zip(made, part, strict=True):
            whole[place] = column
    return Equations(*(column.reshape(-1, *column.shape[2:]) for column in made))


class Ridge(NamedTuple):
    """How parameters are found from normal equations."""

    strength: float  # lambda [-]
    weights: Array  # w (m,) of the efforts
    combination: Array  # K (b, 10 L + ...) of the first b parameters; the others stand for themselves


def solve(equations: Equations, ridge: Ridge) -> Array:
    """Parameters (p,) from equations of one cell.

    Raises
    ------
    LinAlgError
        If the columns are linearly dependent and no ridge tells them apart.
    """
    scaled, size = scaled_equations(equations, ridge)
    return np.asarray(np.linalg.solve(scaled, ridge.weights @ equations.right[0] / size) / size)


def scaled_equations(equations: Equations, ridge: Ridge) -> tuple[Array, Array]:
    """G + lambda P (p, p) of columns scaled to unit length, and their lengths (p,); raises as `solve` does."""
    G = np.einsum("m,mpq->pq", ridge.weights, equations.gram[0])
    size = np.sqrt(np.diag(G))
    # Scaled up, and told apart by a ridge, rounding would look like any other column.  Of an arm's base parameters some
    # are never seen where a joint is held, and the others are none the worse for it.
    least = 0.0 if len(ridge.combination) else ROUNDING * size.max()
    if not (size > least).all():
        raise np.linalg.LinAlgError("a column is zero throughout")
    scaled = (G + ridge.strength * penalty(G, ridge.combination)) / size / size[:, None]
    if ridge.strength == 0.0 and np.linalg.cond(scaled) > DEPENDENT:
        raise np.linalg.LinAlgError("the columns are linearly dependent")
    return scaled, size


def covariance(equations: Equations, ridge: Ridge, variances: Array) -> Array:
    """The covariance (p, p) of the parameters where rows of each effort err by independent noise of a variance (m,)."""
    scaled, size = scaled_equations(equations, ridge)
    inverse = np.linalg.inv(scaled) / size / size[:, None]
    return np.asarray(inverse @ np.einsum("m,mpq->pq", ridge.weights**2 * variances, equations.gram[0]) @ inverse)


def penalty(G: Array, combination: Array) -> Array:
    """P (p, p): of each parameter its column's square, of base parameters that of the smallest they can be made of."""
    P, b = np.diag(np.diag(G)), len(combination)
    if b:
        D = ((G[:b, :b] @ combination) * combination).sum(axis=0)
        seen = UNSEEN * D.max() < D
        K = combination[:, seen]
        P[:b, :b] = np.linalg.inv((K / D[seen]) @ K.T)
    return P


def path_blocks(t: Array, period: float, moving: Booleans | None = None) -> Integers:
    """The block of the path, 0 to 5, that each sample (N,) is in: the sixth of its period, or of the recording.

    `t` [s]; a `period` of 0 [s] is that of a recording that does not repeat, of which sixths of what is `moving` (N,)
    are taken, all where it is left out.
    """
    since = t - t[0]
    if moving is not None and not moving.all() and not period:
        since = np.concatenate([[0.0], np.cumsum(np.diff(t) * moving[1:])])
    length = period or float(since[-1]) * (1 + 1e-9) or 1.0
    return np.asarray((since / length % 1.0 * BLOCKS).astype(np.int64) % BLOCKS)


def repetitions(t: Array, period: float) -> Integers:
    """The period, from 0, that each sample (N,) is in; the last one need not be whole."""
    return np.asarray(((t - t[0]) / period + 1e-9).astype(np.int64))


def left_out(log: Integers, block: Integers) -> tuple[Booleans, ...]:
    """Which cells (C,), each a block of one log, every group leaves out: schemes of groups (G, C).

    Sixths of the path, its halves, and where there are several, each log, together at most `MOST` groups.
    """
    logs = np.unique(log)
    sixths = block == np.arange(BLOCKS)[:, None]
    halves = block // (BLOCKS // 2) == np.arange(2)[:, None]
    room = MOST - BLOCKS - 2
    together = np.searchsorted(logs, log) * min(room, len(logs)) // len(logs)
    by_log = together == np.arange(min(room, len(logs)))[:, None]
    return (sixths, halves, by_log) if len(logs) > 1 else (sixths, halves)


class Judged(NamedTuple):
    """What a candidate is worth: squared errors over those of the effort, by scheme of leaving out."""

    unseen: tuple[Array, ...]  # of each scheme (G, m): squared error of each group, over the effort's in all of them
    training: Array  # (m,) relative error of the fit to all data

    @property
    def errors(self) -> Array:
        """The relative error (m,) of each effort, the mean over schemes."""
        return np.asarray(np.mean([np.sqrt(shares.sum(axis=0)) for shares in self.unseen], axis=0))

    @property
    def score(self) -> float:
        """The mean of the relative errors."""
        return float(self.errors.mean())


def judged(equations: Equations, ridge: Ridge, schemes: Sequence[Booleans]) -> Judged:
    """Leave each group (G, C) of cells out in turn, and predict it.

    Raises
    ------
    LinAlgError
        If what is left does not tell the parameters apart.
    """
    whole = equations.squares.sum(axis=0)
    unseen = []
    for groups in schemes:
        thetas = [solve(equations.without(out), ridge) for out in groups]
        errors = [equations.of(out).errors(theta)[0] for out, theta in zip(groups, thetas, strict=True)]
        unseen.append(np.array(errors) / whole)
    theta = solve(equations.of(np.ones(len(equations.gram), np.bool_)), ridge)
    return Judged(tuple(unseen), np.sqrt(equations.errors(theta).sum(axis=0) / whole))


def together(parts: Sequence[Judged]) -> Judged:
    """One candidate that consists of fits to different efforts."""
    unseen = tuple(np.concatenate(shares, axis=1) for shares in zip(*(part.unseen for part in parts), strict=True))
    return Judged(unseen, np.concatenate([part.training for part in parts]))


def standard_error(one: Judged, other: Judged | None = None) -> float:
    """The standard error of a score, or of the difference of two, by leaving each group out of it in turn."""
    variances = []
    for i, shares in enumerate(one.unseen):
        values = [shares, *([other.unseen[i]] if other else [])]
        G = len(shares)
        scores = np.array([
            [np.sqrt(np.delete(x, g, axis=0).sum(axis=0) * G / (G - 1)).mean() for g in range(G)] for x in values
        ])  # fmt: skip
        differences = scores[0] - scores[1] if other else scores[0]
        variances.append((G - 1) / G * float(((differences - differences.mean()) ** 2).sum()))
    return float(np.sqrt(np.mean(variances)))


def preferred(candidates: Sequence[Judged], sizes: Sequence[int], eligible: Sequence[bool]) -> tuple[int, int]:
    """The smallest candidate that is not clearly worse than the best, of several the better one; and the best.

    `sizes` are numbers of parameters.

    Raises
    ------
    ValueError
        If none is eligible.
    """
    among = [i for i, good in enumerate(eligible) if good]
    best = min(among, key=lambda i: candidates[i].score)
    near = [
        i
        for i in among
        if candidates[i].score - candidates[best].score <= CLEARLY * standard_error(candidates[i], candidates[best])
    ]
    return min(near, key=lambda i: (sizes[i], candidates[i].score)), best
