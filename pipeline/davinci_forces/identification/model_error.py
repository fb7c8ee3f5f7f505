"""The error of parameters that is due to the model: their change over blocks of path, and over other models.

A model that errs alike in every period has parameters that hardly differ between periods, but are wrong.  They change
if other parts of the path are fitted, or if the model gets a term that it lacks.  The other models have each friction
that may be added, and an offset, which with Coulomb friction is friction by direction.  Those count that predict parts
of the path left out as well as the best: they are not clearly worse, by at most one standard error of the difference.
No motion separates an offset from the weight of a vertical slide.  There it takes half of the constant effort.

    s_model^2 = (s_blocks^2 - s_noise^2 + mean over models of ((theta_i - theta)^2 - s_i^2)) / 2,    at least 0

Blocks and models are two estimates of one square, so their mean is taken.  s_i is the part of the difference that noise
explains: the variance of an efficient estimate is that of another one less that of their difference (Hausman, 1978).
For white noise s_i^2 = s_noise^2 (C_i / C - 1), C the inverse of Phi' Phi.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.identification.candidates import Candidate, CandidatePart, identity
from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.models.model import Parameter
from davinci_forces.maths.models.terms import coulomb, offset
from davinci_forces.maths.selection import (
    CLEARLY,
    MAX_GROUPS,
    PATH_BLOCKS,
    CrossValidation,
    Equations,
    LeftOut,
    Ridge,
    covariance,
    schemes_of,
    solve,
    solve_each,
    standard_error,
    sum_all,
)
from davinci_forces.maths.uncertainty.bootstrap import of_left_out

SLIDING = ("presliding friction", "smooth friction")  # at speed equal to Coulomb friction
WITHOUT_TERM_0 = (", slope", ", curvature")  # corrections, so a model without one states that it is 0
WEAK_RIDGE = 1e-6  # divides effort equally between columns that no data separate, and changes no others


def model_std(part: CandidatePart, theta: Array, noise_std: Array, candidates: Iterable[Candidate], logs: int) -> Array:
    """Estimate the standard error due to the model (p,) of parameters (p,) that have an error of noise (p,)."""
    models = list(other_models(part, candidates, logs))
    best = min((errors for _, errors in models), key=lambda errors: errors.score, default=None)
    near = [m for m, errors in models if best and errors.score - best.score <= CLEARLY * standard_error(errors, best)]
    changes = np.array([squared_changes(part, theta, noise_std, model) for model in near]).reshape(-1, len(theta))
    shared = np.maximum((~np.isnan(changes)).sum(axis=0), 1)
    over_blocks = std_over_blocks(part, logs) ** 2 - noise_std**2
    return np.asarray(np.sqrt(np.maximum((over_blocks + np.nansum(changes, axis=0) / shared) / 2.0, 0.0)))


def squared_changes(part: CandidatePart, theta: Array, noise_std: Array, model: CandidatePart) -> Array:
    """Square the changes of parameters (p,) in another model, less what noise explains.

    A slope or curvature that the model lacks is 0 there.  Of any other parameter that it lacks, the change is NaN.
    """
    theirs, theta_of_model = sums_to_compare(model), solve(sum_all(model.by_block), model.ridge)
    C, C_of_model, squares = unit_variance(part), unit_variance(model), np.full(len(theta), np.nan)
    for i, (name, a) in enumerate(sums_to_compare(part).items()):
        lacking = np.zeros(len(theta_of_model)) if name[0].partition(" of ")[0].endswith(WITHOUT_TERM_0) else None
        if (b := theirs.get(name, lacking)) is not None:
            by_noise = noise_std[i] ** 2 * max(b @ C_of_model @ b / (a @ C @ a) - 1.0, 0.0)
            squares[i] = (b @ theta_of_model - a @ theta) ** 2 - by_noise
    return squares


def unit_variance(part: CandidatePart) -> Array:
    """Compute the covariance (p, p) of a model's parameters under white noise of variance 1 in its weighted efforts."""
    return covariance(sum_all(part.by_block), part.ridge, 1.0 / part.ridge.weights)


def std_over_blocks(part: CandidatePart, logs: int) -> Array:
    """Jackknife the standard errors (p,) of a model's parameters over blocks of path."""
    return jackknife(part.by_block, part.ridge, np.tile(np.arange(PATH_BLOCKS), logs))


def std_over_periods(part: CandidatePart, logs: int) -> Array:
    """Jackknife the standard errors (p,) of a model's parameters over periods, or over blocks of path without them."""
    number, squares = np.tile(np.arange(MAX_GROUPS), logs), part.by_period.squares.sum(axis=1)
    repeats = len(np.unique(number[squares > 0])) > 1
    return jackknife(part.by_period, part.ridge, number) if repeats else std_over_blocks(part, logs)


def jackknife(cells: Equations, ridge: Ridge, number: Integers) -> Array:
    """Jackknife the standard errors (p,) of parameters over groups of cells, by their number (C,)."""
    groups = [number == n for n in np.unique(number) if cells.squares[number == n].any()]
    return of_left_out(solve_each(cells.sum_groups(~out for out in groups), ridge))


def other_models(
    part: CandidatePart, candidates: Iterable[Candidate], logs: int
) -> Iterator[tuple[CandidatePart, CrossValidation]]:
    """Cross-validate the candidates' models of the same joints, each also with an offset; some cannot be refitted."""
    parts = [p for c in candidates for p in c.parts if p.is_coupled == part.is_coupled]
    same = [p for p in parts if p.model.efforts == part.model.efforts]
    schemes = schemes_of(part.library.cells.scored.squares, logs)
    for model in (more for p in same for more in with_offset(p)):
        try:
            yield model, LeftOut(model.by_block, schemes, model.score_cells).cross_validate(model.ridge)
        except np.linalg.LinAlgError:
            continue


def with_offset(part: CandidatePart) -> Iterator[CandidatePart]:
    """Return a part and, if it has neither an offset nor a ridge, the part with an offset."""
    yield part
    names = [parameter.name for parameter in part.library.model.parameters]
    if not part.ridge.strength and offset.name in names and names.index(offset.name) not in part.columns:
        ridge = part.ridge._replace(strength=WEAK_RIDGE)
        yield part._replace(columns=[*part.columns, names.index(offset.name)], ridge=ridge)


def sums_to_compare(part: CandidatePart) -> dict[tuple[str, float], Array]:
    """Return the sum (p,) of parameters that each stands for, by name and scale: itself, or friction at speed."""
    parameters = [part.library.model.parameters[i] for i in part.columns]
    return {identity(p): np.array([float(q is p or is_part_of(q, p)) for q in parameters]) for p in parameters}


def is_part_of(friction: Parameter, parameter: Parameter) -> bool:
    """Whether a friction term has at speed the effect of another parameter, the Coulomb friction of the same joint."""
    name, _, joint = parameter.name.partition(" of ")
    return name == coulomb.name and friction.name.startswith(SLIDING) and friction.name.partition(" of ")[2] == joint
