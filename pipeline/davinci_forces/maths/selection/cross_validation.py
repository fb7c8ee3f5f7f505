"""How well candidates predict what they were not fitted to, and which of them to take.

Parts of a path, to be left out one at a time: what is predicted there has not been seen, nor anything near it.

Leaving a period out repeats the path in what is kept, and rewards every column; a block of path does not.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.selection.ridge import Equations, Ridge, solve

BLOCKS = 6  # of a period, or of a recording that does not repeat
MOST = 20  # groups at most that are left out, one refit each
CLEARLY = 1.0  # standard errors of the difference by which a candidate has to be worse


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
