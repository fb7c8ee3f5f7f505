"""The error of parameters that is due to the model: their change over blocks of path, and over other models.

The guide tells why: `how-far-to-trust-it`.  The other models have each friction that may be added, and an offset, which
with Coulomb friction is friction by direction.  It takes half of the constant effort of a vertical slide, whose weight
no motion separates from it.

    s_model^2 = (s_blocks^2 - s_noise^2 + mean over models of ((theta_i - theta)^2 - s_i^2)) / 2 + s_ridge^2

Blocks and models are two estimates of one square, so their mean is taken; it is at least 0.  s_i is the part of the
difference that noise explains: the variance of an efficient estimate is that of another one less that of their
difference (Hausman, 1978).  For white noise s_i^2 = s_noise^2 (C_i / C - 1), C the inverse of Phi' Phi.  A ridge moves
parameters towards 0.  s_ridge^2 is the square of their change without it, or what noise would add without it if more.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress

import numpy as np

from davinci_forces.identification.candidates import Candidate, CandidatePart, identity
from davinci_forces.maths import selection
from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.models.terms import offset
from davinci_forces.maths.selection import CrossValidation, Equations, LeftOut, Ridge
from davinci_forces.maths.uncertainty.bootstrap import of_left_out

WITHOUT_TERM_0 = (", slope", ", curvature")  # corrections, so a model without one states that it is 0
MAX_WORSE = 2.0  # standard errors of the difference of scores, up to which a model predicts as well as the best
SMALLEST_SQUARE = 1e-12  # squared length of a combination of scaled columns, below which it is rounding
WEAK_RIDGE = 1e-6  # divides effort equally between columns that no data separate, and changes no others


def model_std(part: CandidatePart, theta: Array, noise_std: Array, candidates: Iterable[Candidate], logs: int) -> Array:
    """Estimate the standard error due to the model (p,) of parameters (p,) that have an error of noise (p,)."""
    compared = models_to_compare(part, list(other_models(part, candidates, logs)))
    changes = np.array([squared_changes(part, theta, noise_std, model) for model in compared]).reshape(-1, len(theta))
    shared = np.maximum((~np.isnan(changes)).sum(axis=0), 1)
    blocks = np.tile(np.arange(selection.PATH_BLOCKS), logs)
    over_blocks = jackknife(part.by_block, part.ridge, blocks) ** 2 - noise_std**2
    by_model = (over_blocks + np.nansum(changes, axis=0) / shared) / 2.0
    return np.asarray(np.sqrt(np.maximum(by_model, 0.0) + squares_of_ridge(part, theta, noise_std)))


def squares_of_ridge(part: CandidatePart, theta: Array, noise_std: Array) -> Array:
    """Square the change of parameters (p,) without their ridge, or what noise would add without it if that is more."""
    if part.ridge.strength <= WEAK_RIDGE:
        return np.zeros(len(theta))
    total, ridge = selection.sum_all(part.by_block), part.ridge
    free = selection.solve(total, ridge._replace(strength=WEAK_RIDGE))
    [scaled], [size] = selection.scaled_equations(total, ridge._replace(strength=SMALLEST_SQUARE))
    squares, directions = np.linalg.eigh(scaled)
    free_variance = (directions**2 / np.maximum(squares, SMALLEST_SQUARE)).sum(axis=1) / size**2
    by_noise = noise_std**2 * (free_variance / unit_variance(part) - 1.0)
    return np.asarray(np.maximum((free - theta) ** 2, by_noise))


def models_to_compare(
    part: CandidatePart, models: Sequence[tuple[CandidatePart, bool, CrossValidation]]
) -> list[CandidatePart]:
    """Return the models of other parameters that predict unseen parts of the path as well as the best, and a plain one.

    The best model without added friction gives friction parameters their usual meaning, however it predicts.
    """
    if not models:
        return []
    strongest, own = max(part.ridge.strength, WEAK_RIDGE), identities(part)
    plain = [(m, errors) for m, is_plain, errors in models if is_plain and m.ridge.strength <= strongest]
    best_plain = min(plain, key=lambda pair: pair[1].score, default=(None, None))[0]
    best = min((errors for *_, errors in models), key=lambda errors: errors.score)
    return [
        model
        for model, _, errors in models
        if identities(model) != own
        if model is best_plain or errors.score - best.score <= MAX_WORSE * selection.standard_error(errors, best)
    ]


def squared_changes(part: CandidatePart, theta: Array, noise_std: Array, model: CandidatePart) -> Array:
    """Square the changes of parameters (p,) in another model, less what noise explains.

    A slope or curvature that the model lacks is 0 there.  Of any other parameter that it lacks, the change is NaN.
    """
    names, theta_of_model = identities(model), selection.solve(selection.sum_all(model.by_block), model.ridge)
    variance, variance_of_model, squares = unit_variance(part), unit_variance(model), np.full(len(theta), np.nan)
    for i, name in enumerate(identities(part)):
        if name in names:
            k = names.index(name)
            by_noise = noise_std[i] ** 2 * max(variance_of_model[k] / variance[i] - 1.0, 0.0)
            squares[i] = (theta_of_model[k] - theta[i]) ** 2 - by_noise
        elif name[0].partition(" of ")[0].endswith(WITHOUT_TERM_0):
            squares[i] = theta[i] ** 2
    return squares


def unit_variance(part: CandidatePart) -> Array:
    """Compute the variance (p,) of a model's parameters under white noise of variance 1 in its weighted efforts."""
    return np.diag(selection.covariance(selection.sum_all(part.by_block), part.ridge, 1.0 / part.ridge.weights))


def std_over_periods(part: CandidatePart, logs: int) -> Array:
    """Jackknife the standard errors (p,) of a model's parameters over periods, and blocks of path of logs without any.

    Periods and blocks of one number are left out together, but never a whole log, which may alone excite parameters.
    """
    periods = numbers_of_periods(part.by_period.squares, logs)
    blocks = np.tile(np.arange(selection.PATH_BLOCKS), logs)
    blocks[np.repeat(periods[:: selection.MAX_GROUPS] >= 0, selection.PATH_BLOCKS)] = -1
    number = np.concatenate([periods, blocks])
    cells = (np.concatenate(both)[number >= 0] for both in zip(part.by_period, part.by_block, strict=True))
    return jackknife(Equations(*cells), part.ridge, number[number >= 0])


def numbers_of_periods(squares: Array, logs: int) -> Integers:
    """The number (C,) of each cell's period, by the squared efforts (C, m) in it; -1 in logs that do not repeat."""
    numbers = np.tile(np.arange(selection.MAX_GROUPS), (logs, 1))
    periods = squares.any(axis=1).reshape(logs, -1).sum(axis=1)
    return np.where(periods[:, None] > 1, numbers, -1).ravel()


def jackknife(cells: Equations, ridge: Ridge, number: Integers) -> Array:
    """Jackknife the standard errors (p,) of parameters over groups of cells, by their number (C,)."""
    groups = [number == n for n in np.unique(number) if cells.squares[number == n].any()]
    return of_left_out(selection.solve_each(cells.sum_groups(~out for out in groups), ridge))


def other_models(
    part: CandidatePart, candidates: Iterable[Candidate], logs: int
) -> Iterator[tuple[CandidatePart, bool, CrossValidation]]:
    """Cross-validate models of the same joints, each also with an offset; the flag tells one without added friction."""
    parts = [(p, not c.added) for c in candidates for p in c.parts if p.is_coupled == part.is_coupled]
    same = [(p, is_plain) for p, is_plain in parts if p.model.efforts == part.model.efforts]
    together = [part.library.joints_moving.get(log, 0) for log in range(logs)]
    schemes = selection.schemes_of(part.library.cells.scored.squares, together)
    for model, is_plain in ((more, is_plain) for p, is_plain in same for more in with_offset(p)):
        with suppress(np.linalg.LinAlgError):
            yield model, is_plain, LeftOut(model.by_block, schemes, model.score_cells).cross_validate(model.ridge)


def with_offset(part: CandidatePart) -> Iterator[CandidatePart]:
    """Return a part and, if it has neither an offset nor a ridge, the part with an offset."""
    yield part
    names = [parameter.name for parameter in part.library.model.parameters]
    if not part.ridge.strength and offset.name in names and names.index(offset.name) not in part.columns:
        ridge = part.ridge._replace(strength=WEAK_RIDGE)
        yield part._replace(columns=[*part.columns, names.index(offset.name)], ridge=ridge)


def identities(part: CandidatePart) -> list[tuple[str, float]]:
    """Return the name and the scale of each parameter of a part."""
    parameters = part.library.model.parameters
    return [identity(parameters[i]) for i in part.columns]
