"""The choice among candidate models, and the parameters of the fitted candidates."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from davinci_forces.identification.candidates import Candidate, Library
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.estimation.conic import nearest
from davinci_forces.maths.estimation.least_squares import Triangle
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.selection import (
    MAX_GROUPS,
    PATH_BLOCKS,
    CrossValidation,
    Equations,
    Ridge,
    choose_candidate,
    covariance,
    left_out,
    scaled_equations,
    standard_error,
)
from davinci_forces.robots.models import Reach
from davinci_forces.robots.robot import Robot

NEGLIGIBLE_EXCESS = 1e-8  # a smaller share of the effort's square is within the solver's accuracy


@dataclass(frozen=True, eq=False)
class Selection:
    """Candidates with their scores, the chosen one, the best one, and the reason of the choice."""

    candidates: tuple[Candidate, ...]
    physical: tuple[bool, ...]
    score: Array
    score_std: Array
    training: Array
    over_periods: Array  # scores with periods left out; NaN if no path repeats
    chosen: Candidate
    best: Candidate
    why: str


class BlockEstimate(NamedTuple):
    """Parameters (p,) with their standard errors: for uncorrelated residuals, and from blocks left out."""

    theta: Array
    theta_std_classical: Array
    theta_std: Array
    samples: int
    mse: float
    r2: float
    condition: float


def select_candidate(candidates: Sequence[Candidate], reaches: dict[str, Reach], count: int) -> Selection | None:
    """Cross-validate all candidates on the same groups, and choose one; None if none can be refitted."""
    schemes = usable_schemes(candidates, count)
    pairs = [(c, errors) for c in candidates if (errors := c.cross_validate(schemes, reaches))] if schemes else []
    if not pairs:
        return None
    models, results = (list(column) for column in zip(*pairs, strict=True))
    physical = [c.is_physical(reaches) for c in models]
    eligible = physical if any(physical) else [True] * len(models)
    sizes = [c.size(reaches) for c in models]
    chosen, best = choose_candidate(results, sizes, eligible)
    return Selection(
        candidates=tuple(models),
        physical=tuple(physical),
        score=np.array([result.score for result in results]),
        score_std=np.array([standard_error(result) for result in results]),
        training=np.array([result.training.mean() for result in results]),
        over_periods=np.array([over_periods(c, reaches, count) for c in models]),
        chosen=models[chosen],
        best=models[best],
        why=reason(models, results, sizes, chosen, best),
    )


def usable_schemes(candidates: Sequence[Candidate], count: int) -> list[Booleans]:
    """Return the leave-out schemes in which each refit has data of every effort."""
    log, block = np.repeat(np.arange(count), PATH_BLOCKS), np.tile(np.arange(PATH_BLOCKS), count)
    by_library = {id(library): library.by_block.squares for c in candidates for library in c.libraries}
    squares = np.concatenate(list(by_library.values()), axis=1)
    return [groups for groups in left_out(log, block) if all(bool((squares[~g].sum(axis=0) > 0).all()) for g in groups)]


def over_periods(candidate: Candidate, reaches: dict[str, Reach], count: int) -> float:
    """Return the score on periods left out, whose path is that of the fitted periods; NaN if no path repeats."""
    number = np.tile(np.arange(MAX_GROUPS), count)
    squares = np.concatenate([library.by_period.squares for library in candidate.libraries], axis=1)
    groups = np.array([number == k for k in range(MAX_GROUPS) if squares[number == k].any()])
    if len(groups) < 2 or not all((squares[~group].sum(axis=0) > 0).all() for group in groups):
        return float("nan")
    errors = candidate.cross_validate([groups], reaches, by_period=True)
    return errors.score if errors else float("nan")


def reason(
    candidates: Sequence[Candidate], results: Sequence[CrossValidation], sizes: Sequence[int], i: int, best: int
) -> str:
    """State why a candidate was chosen, and whether one that fits better overfits."""
    text = f"{candidates[i].name} has an out-of-sample error of {results[i].score:.4f} of the effort"
    if i == best:
        text += ", less than any other"
    else:
        difference = results[i].score - results[best].score
        text += (
            f"; the best, {candidates[best].name}, errs by {difference:.4f} less, with a standard error of "
            f"{standard_error(results[i], results[best]):.4f}: it is not clearly better, and has {sizes[best]} "
            f"parameters instead of {sizes[i]}"
        )
    training = [result.training.mean() for result in results]
    closest = int(np.argmin(training))
    if results[closest].score > results[i].score:
        text += (
            f"; {candidates[closest].name} fits better ({training[closest]:.4f} instead of {training[i]:.4f}) and "
            f"predicts worse ({results[closest].score:.4f}): it overfits"
        )
    return text


def parameters(
    candidate: Candidate, robot: Robot, reaches: dict[str, Reach], count: int
) -> Iterator[tuple[Model, Library, BlockEstimate]]:
    """Fit a candidate's parameters to all data, one model at a time."""
    block = np.tile(np.arange(PATH_BLOCKS), count)
    fits = candidate.parameters(reaches)
    refits = [candidate.parameters(reaches, block == b) for b in range(PATH_BLOCKS)]
    models = zip(candidate.models(robot, reaches), candidate.libraries, candidate.ridges(), strict=True)
    for i, (model, library, ridge) in enumerate(models):
        theta, thetas = fits[i], np.array([refit[i] for refit in refits])
        cells = library.by_block.columns(library.columns(candidate.friction, reaches))
        total = cells.sum_cells(np.ones(len(cells.gram), np.bool_))
        errors, samples = total.errors(theta)[0], library.samples
        jackknife = (PATH_BLOCKS - 1) / PATH_BLOCKS * ((thetas - thetas.mean(axis=0)) ** 2).sum(axis=0)
        estimate = BlockEstimate(
            theta=theta,
            theta_std_classical=np.sqrt(np.diag(covariance(total, ridge, errors / samples))),
            theta_std=np.sqrt(jackknife),
            samples=int(samples.max()),
            mse=float((errors / samples).sum()),
            r2=float(1.0 - errors.sum() / total.squares[0].sum()),
            condition=float(np.sqrt(np.linalg.cond(scaled_equations(total, ridge)[0]))),
        )
        yield model, library, estimate


class ConsistentFit(NamedTuple):
    """Parameters that a mechanism can have, and the error of each effort (m,) with them and with free ones."""

    estimate: BlockEstimate
    rmse: Array  # (m,)
    rmse_free: Array  # (m,)
    excess: float  # of the criterion over its minimum, as a share of the effort's square


def fit_consistent(
    model: Model, library: Library, equations: Equations, ridge: Ridge, free: BlockEstimate
) -> ConsistentFit:
    """Fit a candidate's parameters within those that a mechanism can have, to the equations (one cell) of all logs.

    The standard errors remain those of the candidate, as `consistent` keeps those of least squares.

    Raises
    ------
    NotIdentifiable
        If the conic program is not solved.
    """
    fit = nearest(factor(equations, ridge), model.mechanism)
    errors, squares = equations.errors(fit.theta)[0], float(equations.squares.sum())
    estimate = free._replace(
        theta=fit.theta, mse=float((errors / library.samples).sum()), r2=float(1.0 - errors.sum() / squares)
    )
    rmse, rmse_free = (np.sqrt(x / library.samples) for x in (errors, equations.errors(free.theta)[0]))
    return ConsistentFit(estimate, rmse, rmse_free, fit.excess)


def factor(equations: Equations, ridge: Ridge) -> Triangle:
    """Factor a ridge problem into |U D theta - y|^2 plus a constant, with the same optimal parameters.

    U' U = D^-1 (G + lambda P) D^-1, and U' y = D^-1 r
    """
    scaled, size = scaled_equations(equations, ridge)
    U = np.asarray(np.linalg.cholesky(scaled).T, np.float64)
    y = np.linalg.solve(U.T, ridge.weights @ equations.right[0] / size)
    return Triangle(U, y, max(float(ridge.weights @ equations.squares[0] - y @ y), 0.0), size)
