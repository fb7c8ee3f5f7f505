"""Choosing among candidates, and the parameters of those that are fitted."""

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
    BLOCKS,
    MOST,
    Equations,
    Judged,
    Ridge,
    covariance,
    left_out,
    preferred,
    scaled_equations,
    standard_error,
)
from davinci_forces.robots.models import Reach
from davinci_forces.robots.robot import Robot

NOTHING = 1e-8  # of the effort's square, below which it costs nothing that the solver would tell


@dataclass(frozen=True, eq=False)
class Selection:
    """Candidates with their scores, one of them chosen."""

    candidates: tuple[Candidate, ...]
    physical: tuple[bool, ...]
    score: Array
    score_std: Array
    training: Array
    over_periods: Array  # NaN where no path repeats
    chosen: Candidate
    best: Candidate
    why: str


class BlockEstimate(NamedTuple):
    """Parameters (p,) with their standard errors: residuals taken as uncorrelated, and from blocks left out."""

    theta: Array
    theta_std_classical: Array
    theta_std: Array
    samples: int
    mse: float
    r2: float
    condition: float


def selected(candidates: Sequence[Candidate], reaches: dict[str, Reach], count: int) -> Selection | None:
    """Judge every candidate on the same groups, and choose one; None where none can be judged."""
    schemes = possible(candidates, count)
    judged = [(c, made) for c in candidates if (made := judge(c, schemes, reaches)) is not None] if schemes else []
    if not judged:
        return None
    kept, verdicts = (list(column) for column in zip(*judged, strict=True))
    physical = [c.is_physical(reaches) for c in kept]
    eligible = physical if any(physical) else [True] * len(kept)
    sizes = [c.size(reaches) for c in kept]
    chosen, best = preferred(verdicts, sizes, eligible)
    return Selection(
        candidates=tuple(kept),
        physical=tuple(physical),
        score=np.array([verdict.score for verdict in verdicts]),
        score_std=np.array([standard_error(verdict) for verdict in verdicts]),
        training=np.array([verdict.training.mean() for verdict in verdicts]),
        over_periods=np.array([over_periods(c, reaches, count) for c in kept]),
        chosen=kept[chosen],
        best=kept[best],
        why=reason(kept, verdicts, sizes, chosen, best),
    )


def judge(
    candidate: Candidate, schemes: Sequence[Booleans], reaches: dict[str, Reach], by_period: bool = False
) -> Judged | None:
    """A candidate's errors on what is left out; None where the rest does not tell its parameters apart."""
    try:
        return candidate.judged(schemes, reaches, by_period)
    except np.linalg.LinAlgError:
        return None


def possible(candidates: Sequence[Candidate], count: int) -> list[Booleans]:
    """The schemes of leaving out in which something of every effort is left in each refit."""
    log, block = np.repeat(np.arange(count), BLOCKS), np.tile(np.arange(BLOCKS), count)
    every = {id(library): library.by_block.squares for c in candidates for library in c.libraries}
    squares = np.concatenate(list(every.values()), axis=1)
    return [groups for groups in left_out(log, block) if all(bool((squares[~g].sum(axis=0) > 0).all()) for g in groups)]


def over_periods(candidate: Candidate, reaches: dict[str, Reach], count: int) -> float:
    """The score on periods left out, which repeat the path of those that are kept; NaN where a path does not."""
    number = np.tile(np.arange(MOST), count)
    squares = np.concatenate([library.by_period.squares for library in candidate.libraries], axis=1)
    groups = np.array([number == k for k in range(MOST) if squares[number == k].any()])
    if len(groups) < 2 or not all((squares[~group].sum(axis=0) > 0).all() for group in groups):
        return float("nan")
    judged = judge(candidate, [groups], reaches, by_period=True)
    return judged.score if judged else float("nan")


def reason(candidates: Sequence[Candidate], verdicts: Sequence[Judged], sizes: Sequence[int], i: int, best: int) -> str:
    """Why a candidate was chosen, in words, and whether a larger one only fitted better."""
    own = f"{candidates[i].name} errs by {verdicts[i].score:.4f} of the effort where it was not fitted"
    if i == best:
        said = f"{own}, less than any other"
    else:
        behind = verdicts[i].score - verdicts[best].score
        doubt = standard_error(verdicts[i], verdicts[best])
        said = (
            f"{own}; the best, {candidates[best].name}, by {behind:.4f} less, which with a standard error of "
            f"{doubt:.4f} is not clearly better, and it has {sizes[best]} parameters for {sizes[i]}"
        )
    training = [verdict.training.mean() for verdict in verdicts]
    closest = int(np.argmin(training))
    if verdicts[closest].score > verdicts[i].score:
        said += (
            f"; {candidates[closest].name} fits better ({training[closest]:.4f} for {training[i]:.4f}) and predicts "
            f"worse ({verdicts[closest].score:.4f}): it overfits"
        )
    return said


def parameters(
    candidate: Candidate, robot: Robot, reaches: dict[str, Reach], count: int
) -> Iterator[tuple[Model, Library, BlockEstimate]]:
    """What a candidate's parameters are, one model at a time, from all data."""
    block = np.tile(np.arange(BLOCKS), count)
    whole = candidate.parameters(reaches)
    without = [candidate.parameters(reaches, block == b) for b in range(BLOCKS)]
    each = zip(candidate.models(robot, reaches), candidate.libraries, candidate.ridges(), strict=True)
    for i, (model, library, ridge) in enumerate(each):
        theta, thetas = whole[i], np.array([part[i] for part in without])
        cells = library.by_block.columns(library.columns(candidate.friction, reaches))
        together = cells.of(np.ones(len(cells.gram), np.bool_))
        errors, samples = together.errors(theta)[0], library.samples
        jackknife = (BLOCKS - 1) / BLOCKS * ((thetas - thetas.mean(axis=0)) ** 2).sum(axis=0)
        estimate = BlockEstimate(
            theta=theta,
            theta_std_classical=np.sqrt(np.diag(covariance(together, ridge, errors / samples))),
            theta_std=np.sqrt(jackknife),
            samples=int(samples.max()),
            mse=float((errors / samples).sum()),
            r2=float(1.0 - errors.sum() / together.squares[0].sum()),
            condition=float(np.sqrt(np.linalg.cond(scaled_equations(together, ridge)[0]))),
        )
        yield model, library, estimate


class Held(NamedTuple):
    """Parameters that a mechanism can have, and what each effort's model errs by with them and without."""

    estimate: BlockEstimate
    rmse: Array  # (m,)
    rmse_free: Array  # (m,)
    excess: float  # of the criterion over its least, as a share of the effort's square


def held(model: Model, library: Library, equations: Equations, ridge: Ridge, free: BlockEstimate) -> Held:
    """The parameters nearest to a candidate's that a mechanism can have, from the equations (of one cell) of all logs.

    The standard errors stay the candidate's, as those of the estimator `consistent` stay least squares'.

    Raises
    ------
    NotIdentifiable
        If the conic program is not solved.
    """
    made = nearest(factor(equations, ridge), model.mechanism)
    errors, squares = equations.errors(made.theta)[0], float(equations.squares.sum())
    estimate = free._replace(
        theta=made.theta, mse=float((errors / library.samples).sum()), r2=float(1.0 - errors.sum() / squares)
    )
    rmse, rmse_free = (np.sqrt(x / library.samples) for x in (errors, equations.errors(free.theta)[0]))
    return Held(estimate, rmse, rmse_free, made.excess)


def factor(equations: Equations, ridge: Ridge) -> Triangle:
    """A triangle that asks for the same parameters as a ridge: |U D theta - y|^2 but for a constant.

    U' U = D^-1 (G + lambda P) D^-1, and U' y = D^-1 r
    """
    scaled, size = scaled_equations(equations, ridge)
    U = np.asarray(np.linalg.cholesky(scaled).T, np.float64)
    y = np.linalg.solve(U.T, ridge.weights @ equations.right[0] / size)
    return Triangle(U, y, max(float(ridge.weights @ equations.squares[0] - y @ y), 0.0), size)
