"""The choice among candidate models, and the parameters of the fitted candidates."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from davinci_forces.identification.candidates import Candidate, CandidatePart
from davinci_forces.identification.model_error import model_std, numbers_of_periods, std_over_periods
from davinci_forces.maths import selection
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.conic import nearest
from davinci_forces.maths.estimation.least_squares import Triangle
from davinci_forces.maths.selection import MAX_GROUPS, CrossValidation, Equations, Ridge, standard_error, sum_all
from davinci_forces.maths.uncertainty.bootstrap import error_of_mean
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records.prediction import CHOSEN

LAST_DIGIT = 1e-4  # of printed errors; scores closer than this are equal
NEGLIGIBLE_EXCESS = 1e-8  # a smaller share of the effort's square is within the solver's accuracy
MIN_INERTIA_SHARE = 1e-3  # of a joint's effort over its paths


@dataclass(frozen=True, eq=False)
class Selection:
    """Candidates with their scores, the chosen one, the best one, and the reason of the choice."""

    candidates: tuple[Candidate, ...]
    results: tuple[CrossValidation, ...]
    physical: tuple[bool, ...]
    repeated: tuple[tuple[float, float], ...]  # score with periods left out, and its error; NaN if no path repeats
    chosen: Candidate
    best: Candidate
    why: str

    @property
    def scores(self) -> dict[str, Array]:
        """The scores of all candidates with their errors: on data left out, in training, and over periods."""
        fits, (over_periods, over_periods_std) = [result.fit for result in self.results], np.array(self.repeated).T
        return {
            "score": np.array([result.score for result in self.results]),
            "score_std": np.array([standard_error(result) for result in self.results]),
            "training": np.array([fit.score for fit in fits]),
            "training_std": np.array([standard_error(fit) for fit in fits]),
            "over_periods": over_periods,
            "over_periods_std": over_periods_std,
        }

    def score_of(self, candidate: Candidate) -> float:
        """Return the error of one of the candidates."""
        return self.results[[c.name for c in self.candidates].index(candidate.name)].score


class BlockEstimate(NamedTuple):
    """Parameters (p,) with their standard errors: for uncorrelated residuals, of noise, of the model, and in total."""

    theta: Array
    theta_std_classical: Array
    theta_std_noise: Array
    theta_std_model: Array
    theta_std: Array
    samples: int
    mse: float
    mse_std: float
    r2: float
    r2_std: float
    condition: float


def select_candidate(candidates: Sequence[Candidate], count: int) -> Selection | None:
    """Cross-validate all candidates on the same groups, and choose one; None if none can be refitted."""
    libraries = {id(part.library): part.library for c in candidates for part in c.parts}.values()
    together = [max(library.joints_moving.get(log, 0) for library in libraries) for log in range(count)]
    schemes = selection.schemes_of(np.concatenate([x.cells.by_block.squares for x in libraries], axis=1), together)
    pairs = [(c, errors) for c in candidates if (errors := c.cross_validate(schemes))] if schemes else []
    if not pairs:
        return None
    models, results = zip(*pairs, strict=True)
    physical = tuple(c.is_physical for c in models)
    eligible = physical if any(physical) else [True] * len(models)
    i, best = selection.choose_candidate(results, [c.rank for c in models], eligible)
    repeated = tuple(over_periods(c, count) for c in models)
    why = reason(models, results, i, best, eligible)
    return Selection(models, results, physical, repeated, models[i], models[best], why)


def better(fixed: Selection, searched: Selection | None) -> Selection:
    """Return the selection whose chosen candidate errs less, named `chosen`, with the candidates of both.

    If physics forbids that one, and it is chosen nevertheless, the others that physics forbids compete with it.
    """
    both = [fixed, *([searched] if searched else [])]
    candidates, results, physical, repeated = (
        tuple(x for of in both for x in getattr(of, name)) for name in ("candidates", "results", "physical", "repeated")
    )
    place = {c.name: i for i, c in enumerate(candidates)}
    i = min((place[of.chosen.name] for of in both), key=lambda k: results[k].score)
    eligible = physical if physical[i] else (True,) * len(candidates)
    if not physical[i]:
        ranked = [(of, [c.rank for c in of.candidates]) for of in both]
        free = [of.candidates[selection.choose_candidate(of.results, r, [True] * len(r))[0]] for of, r in ranked]
        i = min((place[c.name] for c in free), key=lambda k: results[k].score)
    best = min(np.flatnonzero(eligible).tolist(), key=lambda k: results[k].score)
    chosen, why = candidates[i]._replace(variant=CHOSEN), reason(candidates, results, i, best, eligible)
    return Selection(candidates, results, physical, repeated, chosen, candidates[best], why)


def over_periods(candidate: Candidate, count: int) -> tuple[float, float]:
    """Score a candidate on periods left out, on the path of the fitted ones; NaN with its error if no path repeats."""
    squares = np.concatenate([part.library.cells.by_period.squares for part in candidate.parts], axis=1)
    number = numbers_of_periods(squares, count)
    groups = np.array([number == k for k in range(MAX_GROUPS) if squares[number == k].any()])
    if len(groups) < 2 or not all((squares[~group].sum(axis=0) > 0).all() for group in groups):
        return float("nan"), float("nan")
    errors = candidate.cross_validate([groups], by_period=True)
    return (errors.score, standard_error(errors)) if errors else (float("nan"), float("nan"))


def reason(
    candidates: Sequence[Candidate], results: Sequence[CrossValidation], i: int, best: int, eligible: Sequence[bool]
) -> str:  # fmt: skip
    """State why a candidate was chosen, and whether one that fits better overfits."""
    text = f"{candidates[i].name} has an out-of-sample error of {results[i].score:.4f} of the effort"
    if i == best:
        text += ", less than any other"
    else:
        difference, std = by_more(results[i], results[best])
        peers = {
            c.name: by_more(result, results[best])
            for c, result, is_eligible in zip(candidates, results, eligible, strict=True)
            if is_eligible and (c.rank, c.variant == CHOSEN) == (candidates[i].rank, candidates[i].variant == CHOSEN)
        }
        close, (more, error) = min(peers.items(), key=lambda peer: peer[1][0] - peer[1][1])
        kind = "share links" if candidates[i].variant == CHOSEN else f"have {candidates[i].size} parameters"
        if difference <= std:
            why = "it is not clearly better"
        elif more <= error:
            why = (
                f"models that {kind} are preferred unless all are clearly worse, and {close} is not ({more:.4f}, with "
                f"{error:.4f}); of them, the one with the least error is chosen"
            )
        else:
            why = "it gave way to a smaller model, which errs more than the chosen one"
        text += (
            f"; the best, {candidates[best].name}, errs by {difference:.4f} less, with a standard error of {std:.4f}: "
            f"{why}. The best has {candidates[best].size} parameters, the chosen one {candidates[i].size}"
        )
    training = [result.fit.score for result in results]
    closest = int(np.argmin(training))
    (excess, error), gain = by_more(results[closest], results[i]), training[i] - training[closest]
    if gain > LAST_DIGIT and excess > max(LAST_DIGIT, NORMAL_95 * error):
        text += (
            f"; {candidates[closest].name} fits better ({training[closest]:.4f} instead of {training[i]:.4f}) and "
            f"predicts worse ({results[closest].score:.4f}, more by {excess:.4f}, with a standard error of "
            f"{error:.4f}): it overfits"
        )
    return text


def by_more(result: CrossValidation, best: CrossValidation) -> tuple[float, float]:
    """By how much a candidate errs more than the best one, with its standard error."""
    return result.score - best.score, standard_error(result, best)


def parameters(
    candidate: Candidate, count: int, others: Sequence[Candidate]
) -> Iterator[tuple[CandidatePart, BlockEstimate]]:
    """Fit a candidate's parameters to all data of `count` logs, one part at a time, and compare them with others."""
    for part, theta in zip(candidate.parts, candidate.parameters(), strict=True):
        ridge, samples = part.ridge, part.library.cells.samples
        total = sum_all(part.by_block)
        errors = total.errors(theta)[0]
        noise = std_over_periods(part, count)
        model = model_std(part, theta, noise, others, count)
        estimate = BlockEstimate(
            theta=theta,
            theta_std_classical=np.sqrt(np.diag(selection.covariance(total, ridge, errors / samples))),
            theta_std_noise=noise,
            theta_std_model=model,
            theta_std=np.hypot(noise, model),
            samples=int(samples.max()),
            condition=float(np.sqrt(np.linalg.cond(selection.scaled_equations(total, ridge)[0][0]))),
            **scores(part, theta),
        )
        yield part, estimate


def scores(part: CandidatePart, theta: Array) -> dict[str, float]:
    """Compute the mean squared error and R2 of parameters (p,), with standard errors by blocks of path."""
    cells, total, samples = part.by_block, sum_all(part.by_block), part.library.cells.samples
    errors, by_cell = total.errors(theta)[0], (cells.errors(theta) / samples).sum(axis=1)[cells.squares.any(axis=1)]
    mse, std = float((errors / samples).sum()), len(by_cell) * error_of_mean(by_cell)
    unexplained = float(errors.sum() / (total.squares.sum() - (part.library.cells.sums**2 / samples).sum()))
    return {"mse": mse, "mse_std": std, "r2": 1.0 - unexplained, "r2_std": unexplained * std / (mse or 1.0)}


def fit_consistent(part: CandidatePart, free: BlockEstimate) -> tuple[BlockEstimate, Array, Array, float]:
    """Fit a candidate's parameters within those that a mechanism can have, to the equations of all logs.

    Returns also the error of each effort (m,) with them and with free ones, and the excess of the criterion over its
    minimum, as a share of the effort's square.
    The standard errors remain those of the candidate, as `consistent` keeps those of least squares.  A joint by itself
    has at least the inertia that causes `MIN_INERTIA_SHARE` of its effort, because a filter divides by it.
    Raises NotIdentifiable if the conic program is not solved.
    """
    equations, samples = sum_all(part.by_block), part.library.cells.samples
    R, mechanism = factor(equations, part.ridge), part.model.mechanism
    fit = nearest(R, mechanism)
    if not part.is_coupled and not part.is_physical(fit.theta):
        size = float(np.sqrt(R.y @ R.y + R.min_squares))
        is_inertia = part.library.inertias[..., part.columns].any(axis=(0, 1, 2))
        least = np.where(is_inertia, MIN_INERTIA_SHARE * size / R.scale, 0.0)
        theta = least + nearest(R._replace(y=R.y - R.U @ (R.scale * least)), mechanism).theta
        fit = fit._replace(theta=theta, excess=float(R.excess(theta)) / size**2)
    estimate = free._replace(theta=fit.theta, **scores(part, fit.theta))  # type: ignore[arg-type]
    rmse, rmse_free = (np.sqrt(equations.errors(theta)[0] / samples) for theta in (fit.theta, free.theta))
    return estimate, rmse, rmse_free, fit.excess


def factor(equations: Equations, ridge: Ridge) -> Triangle:
    """Factor a ridge problem into |U D theta - y|^2 plus a constant, with the same optimal parameters.

    U' U = D^-1 (G + lambda P) D^-1, and U' y = D^-1 r
    """
    [scaled], [size] = selection.scaled_equations(equations, ridge)
    U = np.asarray(np.linalg.cholesky(scaled).T, np.float64)
    y = np.linalg.solve(U.T, ridge.weights @ equations.right[0] / size)
    return Triangle(U, y, max(float(ridge.weights @ equations.squares[0] - y @ y), 0.0), size)
