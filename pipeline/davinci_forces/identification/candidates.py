"""All candidate models, with the normal equations of all logs; candidates of one library share the equations.

A library is a model with every friction that may be added.  A candidate is a choice of its columns, and a ridge.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.identification.observations import Observed, equations
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.models.terms import Term, presliding_friction
from davinci_forces.maths.selection import CrossValidation, Equations, Ridge, combine_efforts, cross_validate, solve
from davinci_forces.robots.models import ARM, AddedFriction, Reach, coupled_arm, frictions, independent, round_scale
from davinci_forces.robots.robot import Robot

RIDGES = {"independent": (0.0, 1e-3), "coupled": (1e-4, 1e-3, 1e-2, 3e-2)}
WEIGHTS_RIDGE = Ridge(1e-3, np.ones(1), np.empty((0, 0)))
POSES = 50  # number of poses of each log at which the inertia has to be positive definite


class Library(NamedTuple):
    """A model with all candidate friction, and the equations of its efforts."""

    model: CoupledArm | IndependentJoint
    logs: tuple[Observed, ...]
    added: tuple[tuple[Term, ...], ...]  # friction terms of each effort
    samples: Integers  # (m,) number of samples in the equations of each effort
    by_block: Equations
    by_period: Equations
    inertias: Array  # (S, m, m, p) with M = inertias theta, along the trajectories

    def columns(self, friction: AddedFriction, reaches: dict[str, Reach]) -> list[int]:
        """Return the indices of a candidate's parameters: those of the model, and those of one friction."""
        suffixes = [f" of {effort}" if len(self.model.efforts) > 1 else "" for effort in self.model.efforts]
        efforts = zip(self.model.efforts, suffixes, self.added, strict=True)
        added = {f"{t.name}{suffix}": (effort, t) for effort, suffix, terms in efforts for t in terms}
        indices = []
        for i, parameter in enumerate(self.model.parameters):
            effort, term = added.get(parameter.name, ("", None))
            wanted = (
                {(t.width, t.decay_velocity, t.displacement) for t in friction.terms(reaches[effort])}
                if term
                else set()
            )
            if term is None or (term.width, term.decay_velocity, term.displacement) in wanted:
                indices.append(i)
        return indices

    @property
    def combination(self) -> Array:
        """The combinations of inertial parameters that the model's first parameters are; empty for a single joint."""
        return self.model.base.combination if isinstance(self.model, CoupledArm) else np.empty((0, 0))


class Candidate(NamedTuple):
    """A structure with a friction and a ridge: one model, or one per joint."""

    structure: str
    shared: bool  # whether the joints share parameters
    friction: AddedFriction
    strength: float  # of the ridge
    libraries: tuple[Library, ...]
    weights: tuple[Array, ...]  # of the efforts of each library

    @property
    def variant(self) -> str:
        """The name of the model, as in fits."""
        return f"{self.structure}+{self.friction.variant}".removesuffix("+")

    @property
    def estimator(self) -> str:
        """The name of the candidate's estimator."""
        return "ridge" if self.strength else "lse"

    @property
    def name(self) -> str:
        """Unique name."""
        friction = f"+{self.friction}" if self.friction.variant else ""
        separate = ", joint by joint" if self.structure == "coupled" and not self.shared else ""
        ridge = f", ridge {self.strength:g}" if self.strength else ""
        return f"{self.structure}{friction}{separate}{ridge}"

    def ridges(self) -> Iterator[Ridge]:
        """Return the ridge of each library."""
        for library, weights in zip(self.libraries, self.weights, strict=True):
            yield Ridge(self.strength, weights, library.combination)

    def size(self, reaches: dict[str, Reach]) -> int:
        """Return the number of parameters."""
        return sum(len(library.columns(self.friction, reaches)) for library in self.libraries)

    def cross_validate(
        self, schemes: Sequence[Booleans], reaches: dict[str, Reach], by_period: bool = False
    ) -> CrossValidation | None:
        """Compute the errors on data left out; None if the remaining data do not separate the parameters."""
        parts = []
        for library, ridge in zip(self.libraries, self.ridges(), strict=True):
            cells = library.by_period if by_period else library.by_block
            try:
                parts.append(cross_validate(cells.columns(library.columns(self.friction, reaches)), ridge, schemes))
            except np.linalg.LinAlgError:
                return None
        return combine_efforts(parts)

    def parameters(self, reaches: dict[str, Reach], out: Booleans | None = None) -> list[Array]:
        """Fit theta of each library to all cells, or without some of them."""
        thetas = []
        for library, ridge in zip(self.libraries, self.ridges(), strict=True):
            cells = library.by_block.columns(library.columns(self.friction, reaches))
            thetas.append(solve(cells.sum_cells(np.ones(len(cells.gram), np.bool_) if out is None else ~out), ridge))
        return thetas

    def models(self, robot: Robot, reaches: dict[str, Reach]) -> list[Model]:
        """Return the model of each library, with this friction only."""
        models: list[Model] = []
        for library in self.libraries:
            efforts, group = library.model.efforts, library.model.group
            added = [self.friction.terms(reaches[effort]) for effort in efforts]
            if self.structure == "independent":
                models.append(independent(robot.joint(group), added[0], self.friction.variant))
            else:
                rows = [library.model.joints.index(effort) for effort in efforts]
                models.append(coupled_arm(robot, rows, added, self.friction.variant, group))
        return models

    def is_physical(self, reaches: dict[str, Reach]) -> bool:
        """Whether the inertia is positive definite along the trajectories."""
        for library, values in zip(self.libraries, self.parameters(reaches), strict=True):
            theta = np.zeros(len(library.model.parameters))
            theta[library.columns(self.friction, reaches)] = values
            if np.linalg.eigvalsh(library.inertias @ theta).min() <= 0:
                return False
        return True


def candidates(
    robot: Robot,
    separate: dict[str, tuple[Observed, ...]],
    arm: tuple[Observed, ...],
    reaches: dict[str, Reach],
    count: int,
) -> list[Candidate]:
    """Return all candidate models of `count` logs.

    `separate` are the logs of each joint alone, `arm` the logs of all joints together.
    """
    added = {name: every_term(reach) for name, reach in reaches.items()}
    independents = tuple(
        library(independent(robot.joint(name), added[name]), logs, (added[name],), count)
        for name, logs in separate.items()
    )
    models = variants("independent", False, independents, [np.ones(1)] * len(independents))
    if not arm:
        return models
    rows = [i for i, joint in enumerate(robot.joints) if joint.name in separate]
    libraries = [coupled_library(robot, [row], arm, added, count) for row in rows]
    models += variants("coupled", False, tuple(libraries), [np.ones(1)] * len(libraries))
    if share_parameters(robot, rows):
        weights = np.array([1.0 / residual_variance(part, reaches) for part in libraries])
        models += variants("coupled", True, (coupled_library(robot, rows, arm, added, count),), [weights])
    return models


def share_parameters(robot: Robot, rows: Sequence[int]) -> bool:
    """Whether joints (indices) may share the parameters of links; a drive of unknown gain prevents it."""
    return len(rows) > 1 and not any(robot.joints[row].effort for row in rows)


def coupled_library(
    robot: Robot, rows: Sequence[int], arm: tuple[Observed, ...], added: dict[str, tuple[Term, ...]], count: int
) -> Library:
    """Return the library of joints (indices) of a coupled arm that share parameters."""
    names = [robot.joints[row].name for row in rows]
    terms = tuple(added[name] for name in names)
    return library(coupled_arm(robot, rows, terms, group=ARM if len(rows) > 1 else names[0]), arm, terms, count)


def variants(structure: str, shared: bool, libraries: tuple[Library, ...], weights: Sequence[Array]) -> list[Candidate]:
    """Return the candidates of a structure, with every friction and ridge."""
    return [
        Candidate(structure, shared, friction, strength, libraries, tuple(weights))
        for friction in frictions()
        for strength in RIDGES[structure]
    ]


def library(
    model: CoupledArm | IndependentJoint, logs: tuple[Observed, ...], added: tuple[tuple[Term, ...], ...], count: int
) -> Library:
    """Return a model with its equations."""
    poses = np.concatenate([log.motion.q[:: max(1, len(log.tau) // POSES)] for log in logs])
    return Library(model, logs, added, *equations(model, logs, count), model.inertia_columns(poses))


def every_term(reach: Reach) -> tuple[Term, ...]:
    """Return all friction that may be added to a joint, each term once."""
    terms = {(t.width, t.decay_velocity, t.displacement): t for friction in frictions() for t in friction.terms(reach)}
    slow = sorted(t.displacement for t in terms.values() if t.displacement)
    others = (t for t in terms.values() if not t.displacement)
    return (*others, *(presliding_friction(x, number) for number, x in enumerate(slow, start=1)))


def residual_variance(part: Library, reaches: dict[str, Reach]) -> float:
    """Return the residual variance of a joint of a coupled arm, with its own parameters and no added friction."""
    cells = part.by_block.columns(part.columns(AddedFriction(""), reaches))
    total = cells.sum_cells(np.ones(len(cells.gram), np.bool_))
    theta = solve(total, WEIGHTS_RIDGE._replace(combination=part.combination))
    return float(total.errors(theta)[0, 0])


def reach_of(logs: Sequence[Observed], joint: str) -> Reach:
    """Return the range and the speed of a joint's motion, over all logs that move it."""
    ranges, squares, count = [0.0], 0.0, 0
    for log in logs:
        i = [record.joint for record in log.records].index(joint)
        q, dq = (x[:, i][log.records[i].standing == 0] for x in (log.motion.q, log.motion.dq))
        low, high = np.percentile(q, [1.0, 99.0])
        ranges.append(float(high - low))
        squares += float(dq @ dq)
        count += len(dq)
    return Reach(round_scale(max(ranges)), round_scale(float(np.sqrt(squares / count))))
