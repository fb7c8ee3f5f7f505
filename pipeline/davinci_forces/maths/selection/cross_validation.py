"""How well candidates predict what they were not fitted to, and which of them to take."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.selection.equations import Equations
from davinci_forces.maths.selection.ridge import Ridge, solve

CLEARLY = 1.0  # standard errors of the difference by which a candidate has to be worse


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
