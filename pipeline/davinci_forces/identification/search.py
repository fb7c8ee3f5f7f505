"""The search for the model of each joint: its terms, the processing of its motion and effort, and its ridge.

The report describes the steps in `choice`.  Their errors are those of the scores, whatever the low-pass of a step.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from davinci_forces.identification import candidates
from davinci_forces.identification.candidates import Candidate, CandidatePart, Library, coupled_joints
from davinci_forces.identification.observations import Observed, Processing
from davinci_forces.maths.arrays import Array, Booleans, evenly
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.terms import OF_MOTION, TERMS, Term, presliding_friction, smooth_sign, stribeck
from davinci_forces.maths.selection import CLEARLY, CrossValidation, LeftOut, schemes_of, standard_error
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots.models import OPTIONAL_TERMS, Reach, independent, round_scale
from davinci_forces.robots.robot import Joint, Kind, Robot

CUTOFF_GRID = (5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0, 25.0, 30.0)  # [Hz], and the study's own
MAX_CUTOFF = 0.4  # of the sampling rate
LAG_GRID = tuple(0.0025 * k for k in range(-4, 5))  # [s]
RIDGE_GRID = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
DISPLACEMENT_GRID = (0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)  # of the range of the motion
WIDTH_GRID = (0.03, 0.1, 0.3)  # of the root mean square velocity
DECAY_VELOCITY_GRID = (0.1, 0.3, 0.6)  # likewise
SCALE_FACTORS = (0.5, 0.7, 1.4, 2.0)  # of a term's scale, tried where the grids found it
MAX_PRESLIDING = 2  # deflections of one joint
MAX_TERMS = 8  # added to one joint
MIN_BETTER_BLOCKS = 2 / 3  # share of the blocks of path that a step has to improve
MAX_SAMPLES_SEARCH = 20_000  # of each log
MAX_LOGS_SEARCH = 6


class Step(NamedTuple):
    """One step of a search, with its error on parts of the path left out."""

    name: str
    processing: Processing
    terms: tuple[Term, ...]
    strength: float  # of the ridge
    size: int  # number of parameters
    errors: CrossValidation

    @property
    def score(self) -> float:
        """The relative error."""
        return self.errors.score

    def improves(self, step: "Step") -> bool:
        """Whether it has a lower error than another step, and so in most blocks of path."""
        better = (self.errors.unseen[0] < step.errors.unseen[0]).mean()
        return bool(self.score < step.score and better >= MIN_BETTER_BLOCKS)


class SearchResult(NamedTuple):
    """The steps of the search for the model of a joint, and the chosen one."""

    joint: str
    structure: str
    steps: tuple[Step, ...]
    chosen: Step
    best: Step


class JointSearch:
    """The search for the model of one joint."""

    def __init__(self, robot: Robot, joint: str, structure: str, logs: Sequence[Observed], reach: Reach) -> None:
        self.robot, self.joint, self.structure, self.reach = robot, joint, structure, reach
        self.logs = [log._replace(number=number) for number, log in enumerate(logs)]
        self._schemes: list[Booleans] = []
        self._libraries: dict[tuple[Processing, tuple[Term, ...]], Library] = {}
        self._steps: dict[tuple[Processing, tuple[Term, ...]], Step | None] = {}

    def library(self, processing: Processing, terms: tuple[Term, ...]) -> Library:
        """Return the equations of the model with these added terms."""
        key = processing, terms
        if key not in self._libraries:
            logs = [log._replace(processing=(processing,) * len(log.records)) for log in self.logs]
            model = joint_model(self.robot, self.joint, self.structure, terms)
            self._libraries = {key: candidates.library(model, logs, len(logs))}  # only the last is reused
        return self._libraries[key]

    def step(
        self, name: str, processing: Processing, terms: tuple[Term, ...], near: float, among: tuple[Term, ...] = ()
    ) -> Step | None:
        """Cross-validate a model with the best ridge `near` one, by equations of terms `among`; None if singular."""
        key = processing, terms
        if key not in self._steps:
            equations = self.library(processing, among or terms)
            part = equations.part(joint_model(self.robot, self.joint, self.structure, terms))
            together = [equations.joints_moving[log.number] for log in self.logs]
            self._schemes = self._schemes or schemes_of(equations.cells.scored.squares, together)
            left_out, steps = LeftOut(part.by_block, self._schemes, part.score_cells), []
            for strength in neighbours(RIDGE_GRID, near) if near else RIDGE_GRID:
                try:
                    errors = left_out.cross_validate(part.with_ridge(strength).ridge)
                except np.linalg.LinAlgError:
                    continue
                steps.append(Step(name, processing, terms, strength, len(part.columns), errors))
            self._steps[key] = min(steps, key=lambda step: step.score, default=None) if self._schemes else None
        step = self._steps[key]
        return step._replace(name=name) if step else None

    def run(self, start: Processing) -> SearchResult | None:
        """Search from the model without added terms; None if it cannot be refitted."""
        step = self.step("joint terms", start, (), 0.0)
        if step is None:
            return None
        steps, is_first = [step], True
        term = self.add_term(step)  # with the study's low-pass: another one, chosen without the term, may hide it
        if term and term.score < self.improve_processing(step, start, True).score:
            steps, is_first = [step, term], False
        while step is not None:
            moved = self.improve_processing(steps[-1], start, is_first)
            steps += [moved] if moved.improves(steps[-1]) else []
            scaled = self.improve_scale(steps[-1])
            steps += [scaled] if scaled.improves(steps[-1]) else []
            is_first, step = False, self.add_term(steps[-1])
            steps += [step] if step else []
        best = min(steps, key=lambda step: step.score)
        chosen = next(s for s in steps if s.score - best.score <= CLEARLY * standard_error(s.errors, best.errors))
        return SearchResult(self.joint, self.structure, tuple(steps), chosen, best)

    def improve_processing(self, step: Step, start: Processing, everywhere: bool) -> Step:
        """Change the cutoff and the lag in turn while that reduces the error; search `everywhere`, or next to them."""
        rate = min(log.records[0].rate for log in self.logs)
        cutoffs = sorted({*(x for x in CUTOFF_GRID if x <= MAX_CUTOFF * rate), start.cutoff})
        while True:
            cutoff, lag = step.processing
            options = [Processing(x, lag) for x in (cutoffs if everywhere else neighbours(cutoffs, cutoff))]
            better = self.best_processing(step, options)
            lags = LAG_GRID if everywhere else neighbours(LAG_GRID, lag)
            better = self.best_processing(better, [Processing(better.processing.cutoff, x) for x in lags])
            if better.processing == step.processing:
                return step
            step, everywhere = better, False

    def best_processing(self, step: Step, options: Sequence[Processing]) -> Step:
        """Return the step with the best of some processings."""
        steps = (self.step("low-pass and lag", option, step.terms, step.strength) for option in options)
        return min((step, *(s for s in steps if s)), key=lambda s: s.score)

    def improve_scale(self, step: Step) -> Step:
        """Return the step with the best of some scales of the last term that has one, which the grids only bracket."""
        place = next((i for i in reversed(range(len(step.terms))) if step.terms[i].scale), None)
        if place is None:
            return step
        term = step.terms[place]
        others = [term.with_scale(round_scale(term.scale * factor)) for factor in SCALE_FACTORS]
        options = [(*step.terms[:place], other, *step.terms[place + 1 :]) for other in others]
        among = (*step.terms, *others)
        steps = [self.step(f"scale of {term.name}", step.processing, x, step.strength, among) for x in options]
        return min((step, *(s for s in steps if s)), key=lambda s: s.score)

    def add_term(self, step: Step) -> Step | None:
        """Return the step with one more term that has the least error; None if no term reduces it."""
        options = dict(self.options(step.terms)) if len(step.terms) < MAX_TERMS else {}
        among = tuple(dict.fromkeys((*step.terms, *(term for terms in options.values() for term in terms))))
        steps = [
            self.step(name, step.processing, (*step.terms, *terms), step.strength, among)
            for name, terms in options.items()
        ]
        return min((s for s in steps if s and s.improves(step)), key=lambda s: s.score, default=None)

    def options(self, used: Sequence[Term]) -> Iterator[tuple[str, tuple[Term, ...]]]:
        """Return the terms that may be added to those in use, by name.

        Coulomb friction by direction is the sum of Coulomb friction and an offset, which coupled models have.
        """
        joint, names = self.robot.joint(self.joint), {term.name for term in used}
        number = 1 + sum(term.displacement > 0 for term in used)
        if number <= MAX_PRESLIDING:
            for share in DISPLACEMENT_GRID:
                term = presliding_friction(round_scale(share * self.reach.displacement), number)
                if term.displacement not in {t.displacement for t in used}:
                    yield f"presliding friction, {100 * share:g} % of the range", (term,)
        for make, shares in ((smooth_sign, WIDTH_GRID), (stribeck, DECAY_VELOCITY_GRID)):
            for share in shares:
                term = make(round_scale(share * self.reach.velocity))
                if term.name not in names:
                    yield f"{term.name}, {100 * share:g} % of the velocity", (term,)
        for terms in sets_of_terms(joint, self.structure):
            if not names & {term.name for term in terms}:
                yield terms[0].name.partition(", sine")[0], terms


def sets_of_terms(joint: Joint, structure: str) -> Iterator[tuple[Term, ...]]:
    """Return the sets of terms without a scale that a joint's model may be given; angles have harmonics."""
    pairs = [terms for terms in pairwise(OF_MOTION.values()) if terms[0].name.endswith(", sine")]
    yield from ((term,) for term in OF_MOTION.values() if "harmonic" not in term.name)
    yield from pairs if joint.kind is Kind.REVOLUTE else []
    if structure == "independent":
        lacking = [TERMS[name] for name in OPTIONAL_TERMS if name not in {term.name for term in joint.terms}]
        sine = tuple(term for term in lacking if "gravity" in term.name)
        yield from ((term,) for term in lacking if term not in sine)
        yield from [sine] if sine and joint.kind is Kind.REVOLUTE else []


def joint_model(robot: Robot, joint: str, structure: str, terms: Sequence[Term]) -> CoupledArm | IndependentJoint:
    """Return the model of a joint with added terms."""
    if structure == "independent":
        return independent(robot.joint(joint), terms, CHOSEN)
    return coupled_joints(robot, [[j.name for j in robot.joints].index(joint)], {joint: terms}, CHOSEN)


def neighbours(values: Sequence[float], value: float) -> Sequence[float]:
    """Return the value of a sorted list that is nearest to a number, and the values on either side."""
    i = int(np.argmin(np.abs(np.array(values) - value)))
    return values[max(i - 1, 0) : i + 2]


def search_joints(
    robot: Robot, separate: dict[str, tuple[Observed, ...]], arm: tuple[Observed, ...], reaches: dict[str, Reach],
    lowpass: float,
) -> list[SearchResult]:  # fmt: skip
    """Search for the model of each joint, by itself and, if `arm` has logs of all joints, coupled to the others."""
    searches = []
    for joint, logs in separate.items():
        moved = [log for log in arm if log.is_moving[log.joints.index(joint)]]
        for structure, used in (("independent", logs), ("coupled", moved)):
            if used:
                few = [used[i].first_samples(MAX_SAMPLES_SEARCH) for i in evenly(len(used), MAX_LOGS_SEARCH)]
                search = JointSearch(robot, joint, structure, few, reaches[joint])
                searches += [result] if (result := search.run(Processing(lowpass, 0.0))) else []
    return searches


def searched_candidates(
    robot: Robot, searches: Sequence[SearchResult], separate: dict[str, tuple[Observed, ...]],
    arm: tuple[Observed, ...], count: int,
) -> list[Candidate]:  # fmt: skip
    """Return the models that were searched: the best of each joint by itself, and coupled joints that share links."""
    by_joint = ([search for search in searches if search.joint == joint] for joint in separate)
    best = [min(of_joint, key=lambda search: search.chosen.score) for of_joint in by_joint if of_joint]
    if len(best) < len(separate):
        return []
    parts = [searched_part(robot, s, separate[s.joint] if s.structure == "independent" else arm, count) for s in best]
    name = "searched, joint by joint" if len(parts) > 1 else "searched"
    models = [Candidate(name, CHOSEN, describe_terms(best), tuple(parts))]
    coupled = [search for search in searches if search.structure == "coupled"]
    rows = [i for i, joint in enumerate(robot.joints) if joint.name in separate]
    if len(coupled) == len(separate) and candidates.share_parameters(robot, rows):
        alone_parts = [searched_part(robot, search, arm, count) for search in coupled]
        weights = candidates.weights_of(alone_parts)
        for alone in [None, *range(len(coupled))] if len(coupled) > 2 else [None]:
            sharing = [i for i in range(len(coupled)) if i != alone]
            part = shared_part(robot, [coupled[i] for i in sharing], arm, count, weights[sharing])
            name = "" if alone is None else f" except for {coupled[alone].joint}"
            separately = () if alone is None else (alone_parts[alone],)
            for strength in RIDGE_GRID:
                full_name = f"searched, links shared{name}{candidates.ridge_name(strength)}"
                joined = (part.with_ridge(strength), *separately)
                models.append(Candidate(full_name, CHOSEN, describe_terms(coupled), joined))
    return models


def shared_part(
    robot: Robot, searches: Sequence[SearchResult], arm: Sequence[Observed], count: int, weights: Array
) -> CandidatePart:
    """Return the chosen models of joints as one that shares the links, with the weights (m,) of their efforts."""
    joints = [joint.name for joint in robot.joints]
    terms = {search.joint: search.chosen.terms for search in searches}
    processing = {search.joint: search.chosen.processing for search in searches}
    by_joint = tuple(processing.get(joint, arm[0].processing[0]) for joint in joints)
    model = coupled_joints(robot, [joints.index(search.joint) for search in searches], terms, CHOSEN)
    processed = [log._replace(processing=by_joint) for log in arm]
    return candidates.library(model, processed, count).part(model, weights=weights)


def searched_part(robot: Robot, search: SearchResult, logs: Sequence[Observed], count: int) -> CandidatePart:
    """Return the chosen model of a joint, with the equations of all its logs."""
    step = search.chosen
    model = joint_model(robot, search.joint, search.structure, step.terms)
    processed = [log._replace(processing=(step.processing,) * len(log.records)) for log in logs]
    return candidates.library(model, processed, count).part(model, step.strength)


def describe_terms(searches: Sequence[SearchResult]) -> str:
    """Name the added terms of each joint."""
    names = ((search.joint, ", ".join(term.name for term in search.chosen.terms)) for search in searches)
    return "; ".join(f"{joint}: {terms or 'none'}" for joint, terms in names)
