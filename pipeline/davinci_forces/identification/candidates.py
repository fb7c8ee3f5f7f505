"""All candidate models, with the normal equations of all logs; candidates of one library share the equations.

A library is a model with every friction that may be added.  A candidate is a choice of its columns, and a ridge.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.identification.observations import CellEquations, Observed, equations, is_evaluated
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import Model, Parameter
from davinci_forces.maths.models.terms import Term, offset, presliding_friction
from davinci_forces.maths.selection import CrossValidation, Equations, LeftOut, Ridge, combine_efforts, solve, sum_all
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots.models import ARM, Reach, coupled_arm, frictions, independent, round_scale
from davinci_forces.robots.robot import Joint, Robot

RIDGES = {"independent": (0.0, 1e-3), "coupled": (1e-4, 1e-3, 1e-2, 3e-2)}
WEIGHTS_RIDGE = 1e-3  # of the fits whose residual variances weigh the joints
POSES = 50  # number of poses of each log at which the inertia has to be positive definite
SPRING = re.compile(r"friction \d+")  # a presliding friction with the number of its spring


@dataclass(frozen=True)
class Library:
    """A model with all candidate friction, and the equations of its efforts."""

    model: CoupledArm | IndependentJoint
    logs: tuple[Observed, ...]
    cells: CellEquations

    @cached_property
    def inertias(self) -> Array:
        """The columns (S, m, m, p) of M = inertias theta at some poses along the trajectories."""
        poses = [np.stack([r.q[:: max(1, len(log.block) // POSES)] for r in log.records], axis=1) for log in self.logs]
        return self.model.inertia_columns(np.concatenate(poses))

    @property
    def combination(self) -> Array:
        """The combinations of inertial parameters that the model's first parameters are; empty for a single joint."""
        return self.model.base.combination if isinstance(self.model, CoupledArm) else np.empty((0, 0))

    @property
    def joints_moving(self) -> dict[int, int]:
        """The number of joints that move together in each log, by the log's number."""
        return {log.number: int(log.is_moving.sum()) for log in self.logs}

    def part(self, model: Model, strength: float = 0.0, weights: Array | None = None) -> "CandidatePart":
        """Return a model with some of the terms, and a ridge; efforts have `weights` (m,), or the weight 1."""
        numbers = {identity(parameter): i for i, parameter in enumerate(self.model.parameters)}
        columns = [numbers[identity(parameter)] for parameter in model.parameters]
        ridge = Ridge(strength, np.ones(1) if weights is None else weights, self.combination)
        return CandidatePart(model, self, columns, ridge)


def identity(parameter: Parameter) -> tuple[str, float]:
    """The name and the scale of a parameter, without the number of a presliding friction, which differs by model."""
    return SPRING.sub("friction", parameter.name), parameter.scale


class CandidatePart(NamedTuple):
    """One model of a candidate: some columns of a library, with a ridge."""

    model: Model
    library: Library
    columns: list[int]
    ridge: Ridge

    @property
    def is_coupled(self) -> bool:
        """Whether its joints are coupled to the others."""
        return isinstance(self.model, CoupledArm)

    def with_ridge(self, strength: float) -> "CandidatePart":
        """Return the part with a ridge of another strength."""
        return self._replace(ridge=self.ridge._replace(strength=strength))

    def is_physical(self, theta: Array) -> bool:
        """Whether the inertia by parameters (p,) is positive definite along the trajectories."""
        return bool(np.linalg.eigvalsh(self.library.inertias[..., self.columns] @ theta).min() > 0)

    @property
    def by_block(self) -> Equations:
        """The equations in cells of the path."""
        return self.library.cells.by_block.columns(self.columns)

    @property
    def by_period(self) -> Equations:
        """The equations in cells of the periods."""
        return self.library.cells.by_period.columns(self.columns)

    @property
    def score_cells(self) -> Equations:
        """The equations of the scores, in cells of the path."""
        return self.library.cells.scored.columns(self.columns)


class Candidate(NamedTuple):
    """A structure with its terms and ridges: one model, or one per joint."""

    name: str  # unique
    variant: str  # name of the model, as in fits
    added: str  # the terms that are added to the structure
    parts: tuple[CandidatePart, ...]

    @property
    def structure(self) -> str:
        """Whether joints are modelled as `independent` or as `coupled`."""
        return "coupled" if self.parts[0].is_coupled else "independent"

    @property
    def estimator(self) -> str:
        """The name of the candidate's estimator."""
        return "ridge" if any(part.ridge.strength for part in self.parts) else "lse"

    @property
    def size(self) -> int:
        """The number of parameters."""
        return sum(len(part.columns) for part in self.parts)

    @property
    def rank(self) -> int:
        """The preference among candidates that are not clearly worse than the best; the lowest is preferred.

        Among models with the same terms it is the number of parameters.  Among models that were searched, whose terms
        differ by joint, those of shared links precede, because only they hold for any motion of the joints together.
        """
        shares_links = any(len(part.model.efforts) > 1 for part in self.parts)
        return int(not shares_links) if self.variant == CHOSEN else self.size

    def cross_validate(self, schemes: Sequence[Booleans], by_period: bool = False) -> CrossValidation | None:
        """Compute the errors on data left out; None if the remaining data do not separate the parameters."""
        results = []
        for part in self.parts:
            cells, scored = (part.by_period, None) if by_period else (part.by_block, part.score_cells)
            try:
                results.append(LeftOut(cells, schemes, scored).cross_validate(part.ridge))
            except np.linalg.LinAlgError:
                return None
        return combine_efforts(results)

    def parameters(self) -> list[Array]:
        """Fit theta of each part to all cells."""
        return [solve(sum_all(part.by_block), part.ridge) for part in self.parts]

    @property
    def is_physical(self) -> bool:
        """Whether the inertia is positive definite along the trajectories."""
        return all(part.is_physical(theta) for part, theta in zip(self.parts, self.parameters(), strict=True))


def candidates(
    robot: Robot, separate: dict[str, tuple[Observed, ...]], arm: tuple[Observed, ...], reaches: dict[str, Reach],
    count: int,
) -> list[Candidate]:  # fmt: skip
    """Return all candidate models of `count` logs: `separate` are of each joint alone, `arm` of all joints together."""
    added = {name: every_term(reach) for name, reach in reaches.items()}
    every = {name: with_every_term(robot.joint(name), reach) for name, reach in reaches.items()}
    independents = [library(every[name], logs, count) for name, logs in separate.items()]
    models = variants(robot, "independent", reaches, independents)
    if not arm:
        return models
    rows = [i for i, joint in enumerate(robot.joints) if joint.name in separate]
    libraries = [library(coupled_joints(robot, [row], added), arm, count) for row in rows]
    models += variants(robot, "coupled", reaches, libraries)
    if share_parameters(robot, rows):
        plain = next(c for c in models if c.structure == "coupled" and not c.added)
        weights = weights_of(plain.parts)
        shared = library(coupled_joints(robot, rows, added), arm, count)
        models += variants(robot, "coupled", reaches, [shared], weights)
    return models


def share_parameters(robot: Robot, rows: Sequence[int]) -> bool:
    """Whether joints (indices) may share the parameters of links; a drive of unknown gain prevents it."""
    return len(rows) > 1 and not any(robot.joints[row].effort for row in rows)


def coupled_joints(
    robot: Robot, rows: Sequence[int], added: Mapping[str, Sequence[Term]], name: str = "coupled"
) -> CoupledArm:
    """Return the model of joints (indices) of a coupled arm that share parameters, each with its added terms."""
    names = [robot.joints[row].name for row in rows]
    group = ARM if len(rows) > 1 else names[0]
    return coupled_arm(robot, rows, [added[joint] for joint in names], name, group)


def variants(
    robot: Robot, structure: str, reaches: dict[str, Reach], libraries: Sequence[Library], weights: Array | None = None
) -> list[Candidate]:
    """Return the candidates of a structure, with every friction and ridge; with `weights` (m,) joints share links."""
    models = []
    separate = ", joint by joint" if structure == "coupled" and weights is None else ""
    for friction in frictions():
        variant = f"{structure}+{friction.variant}".removesuffix("+")
        added = str(friction) if friction.variant else ""
        parts = []
        for every in libraries:
            terms = {effort: friction.terms(reaches[effort]) for effort in every.model.efforts}
            if isinstance(every.model, CoupledArm):
                model: Model = coupled_joints(robot, every.model.rows, terms, variant)
            else:
                model = independent(robot.joint(every.model.group), terms[every.model.group], variant)
            parts.append(every.part(model, weights=weights))
        for strength in RIDGES[structure]:
            name = f"{structure}{'+' * bool(added)}{added}{separate}{ridge_name(strength)}"
            models.append(Candidate(name, variant, added, tuple(part.with_ridge(strength) for part in parts)))
    return models


def ridge_name(strength: float) -> str:
    """Return the end of a candidate's name that states its ridge."""
    return f", ridge {strength:g}" if strength else ""


def library(model: CoupledArm | IndependentJoint, logs: Sequence[Observed], count: int) -> Library:
    """Return a model with its equations."""
    return Library(model, tuple(logs), equations(model, logs, count))


def every_term(reach: Reach) -> tuple[Term, ...]:
    """Return all friction that may be added to a joint, each term once."""
    terms = {(t.width, t.decay_velocity, t.displacement): t for friction in frictions() for t in friction.terms(reach)}
    slow = sorted(t.displacement for t in terms.values() if t.displacement)
    others = (t for t in terms.values() if not t.displacement)
    return (*others, *(presliding_friction(x, number) for number, x in enumerate(slow, start=1)))


def with_every_term(joint: Joint, reach: Reach) -> IndependentJoint:
    """Return the model of a joint by itself with all friction that may be added, and an offset."""
    return independent(joint, (*every_term(reach), *(() if offset in joint.terms else (offset,))))


def weights_of(parts: Sequence[CandidatePart]) -> Array:
    """Return the weights (m,) of the joints of a coupled arm, the inverse of the residual variance by their own models.

    A joint has weight 0 if its own model has no solution or leaves no residual, as of an effort that is 0 throughout.
    """
    weights = np.zeros(len(parts))
    for i, part in enumerate(parts):
        total = sum_all(part.by_block)
        with suppress(np.linalg.LinAlgError):
            variance = total.errors(solve(total, part.ridge._replace(strength=WEIGHTS_RIDGE)))[0, 0]
            if variance:
                weights[i] = 1.0 / variance
    return weights


def reach_of(logs: Sequence[Observed], joint: str) -> Reach:
    """Return the range and the speed of a joint's motion, over all logs that move it.

    Raises NotIdentifiable if its velocity is 0 throughout, as far as noise lets one tell.
    """
    ranges, squares, count = [], 0.0, 0
    for log in logs:
        i = log.joints.index(joint)
        record = log.records[i]
        q, dq = (x[is_evaluated(record)] for x in (record.q, record.dq))
        low, high = np.percentile(q, [1.0, 99.0])
        ranges.append(float(high - low))
        squares += float(dq @ dq)
        count += len(dq)
    if not squares:
        names = ", ".join(log.records[0].log for log in logs)
        text = f"{joint}: its velocity in {names} is lost in noise"
        raise NotIdentifiable(f"{text}; check the units and the clock of q and dq")
    return Reach(round_scale(max(ranges)), round_scale(float(np.sqrt(squares / count))))
