"""Estimates from a part of the data: what is left out in turn, and the fits to the rest."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimator, Regression
from davinci_forces.maths.arrays import Array

FOLDS = 20  # at most: so many refits show how far a fit can be trusted, whatever the amount of data


def folds(count: int) -> list[int]:
    """The fold of each of so many logs or periods, in order: each is one of its own, or some in a row share one."""
    number = min(count, FOLDS)
    return [i * number // count for i in range(count)]


def refits(problem: Regression, estimate: Estimator) -> Iterator[Array | NotIdentifiable]:
    """The parameters (p,) without each fold of the logs in turn, or why there are none."""
    fold = folds(len(problem.starts))
    for out in range(fold[-1] + 1):
        try:
            yield estimate(part(problem, [log for log, own in enumerate(fold) if own != out])).theta
        except NotIdentifiable as error:
            yield error


def part(problem: Regression, logs: Sequence[int]) -> Regression:
    """The problem of some of its logs, by their number."""
    ends = (*problem.starts[1:], len(problem.tau))
    rows = [np.arange(problem.starts[i], ends[i]) for i in logs]
    kept = np.concatenate(rows)
    return replace(
        problem,
        Phi=problem.Phi[kept],
        tau=problem.tau[kept],
        tau_var=problem.tau_var[kept],
        periods=problem.periods[kept],
        starts=tuple(np.cumsum([0, *map(len, rows[:-1])]).tolist()),
        Phi_cov=None if problem.Phi_cov is None else problem.Phi_cov[list(logs)],
    )
