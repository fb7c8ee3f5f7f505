"""Choose a model of the arm by leaving out blocks of path, fit it to all identification logs and chart its friction."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.identification.candidates import Candidate, Library, candidates, reach_of
from davinci_forces.identification.chosen import NOTHING, BlockEstimate, Selection, held, parameters, selected
from davinci_forces.identification.observations import Observed, observed
from davinci_forces.identification.regression import recorded_motion
from davinci_forces.identification.unseen import predictions
from davinci_forces.identification.used import Identified
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.signals.smoothing import smoothed
from davinci_forces.maths.signals.velocity_map import over_velocity
from davinci_forces.records import Average, Choice, Diagnostic, Fit, FrictionMap, Motion, Prediction, diagnostic
from davinci_forces.robots.models import Reach
from davinci_forces.robots.robot import Robot

CHARTED_ROLES = ("identification", "friction")
CHARTED_ESTIMATORS = ("lse", "ridge")  # the plain ones


def run(
    motions: Annotated[Iterable[Motion], "identification"],
    averages: Iterable[Average],
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
) -> Iterator[Choice | Fit | Prediction | Diagnostic]:
    """One model for the whole arm: its parameters, and its predictions of what each refit had not seen.

    Where a log moves several joints, and the robot has a chain, the joints that move are described together; joints
    that move in other logs only keep their own terms.  A fit that the settings name is made, too.
    """
    logs = by_log(motions, averages, robot, lowpass)
    separate, arm = to_describe(logs, robot)
    if not separate:
        return
    reaches = {name: reach_of(own, name) for name, own in separate.items()}
    every = candidates(robot, separate, arm, reaches, len(logs))
    selection = selected(every, reaches, len(logs))
    if selection is None:
        said = "no model could be chosen: no candidate can be fitted with a part of the path left out"
        yield diagnostic("choose", "arm", "warning", f"{said}; record more of the path, or more periods")
        return
    yield from choice(selection, reaches, logs)
    if not any(selection.physical):
        said = "no candidate's inertia is positive definite along the paths, so the choice goes by scores alone"
        yield diagnostic("choose", "arm", "warning", f"{said}; what fit says of each joint's inertia tells why")
    worth = {f"{c.variant}.{c.estimator}": c for c in (*leading(selection), *named(selection, fit), selection.chosen)}
    by_variant = {c.variant: name for name, c in worth.items()}
    for name, candidate in worth.items():
        if name != "independent.lse":
            found = list(parameters(candidate, robot, reaches, len(logs)))
            yield from (fitted(candidate, candidate.estimator, *part) for part in found)
            if candidate.variant != "independent" and by_variant[candidate.variant] == name:
                yield from possible(candidate, found, robot, reaches)
    for candidate in worth.values():
        yield from predictions(candidate, candidate is selection.chosen, logs, robot, reaches)


def by_log(motions: Iterable[Motion], averages: Iterable[Average], robot: Robot, lowpass: float) -> list[Observed]:
    """The joints of each log, in the robot's order; of several clocks, the first joint's is kept."""
    joints, every = [joint.name for joint in robot.joints], list(averages)
    records: dict[str, list[Motion]] = defaultdict(list)
    for record in motions:
        records[record.log].append(record)
    logs: list[Observed] = []
    for own in records.values():
        ordered = sorted(own, key=lambda record: joints.index(record.joint))
        logs.append(observed([r for r in ordered if len(r) == len(ordered[0])], every, lowpass, len(logs)))
    return logs


def to_describe(logs: Sequence[Observed], robot: Robot) -> tuple[dict[str, tuple[Observed, ...]], tuple[Observed, ...]]:
    """The logs of each joint that is to be described, by itself; and those of all joints, where some move together."""
    whole = tuple(log for log in logs if len(log.records) == len(robot.joints) and log.moving.any())
    arm = whole if robot.chain is not None and any(log.moving.sum() > 1 for log in whole) else ()
    separate: dict[str, list[Observed]] = defaultdict(list)
    for log in arm or logs:
        for i, record in enumerate(log.records):
            if not record.at_rest:
                separate[record.joint].append(log.alone(i))
    order = [joint.name for joint in robot.joints if joint.name in separate]
    return {name: tuple(separate[name]) for name in order}, arm


def choice(selection: Selection, reaches: dict[str, Reach], logs: Sequence[Observed]) -> Iterator[Choice]:
    """What was chosen, and from among what; one a group that the chosen model describes by itself."""
    chosen = selection.chosen
    for library in chosen.libraries:
        yield Choice(
            group=library.model.group,
            model=chosen.variant,
            friction=str(chosen.friction),
            estimator=chosen.estimator,
            chosen=chosen.name,
            best=selection.best.name,
            why=selection.why,
            logs=tuple(log.records[0].log for log in logs),
            candidate=np.array([c.name for c in selection.candidates], object),
            variant=np.array([c.variant for c in selection.candidates], object),
            parameters=np.array([c.size(reaches) for c in selection.candidates]),
            physical=np.array(selection.physical, int),
            score=selection.score,
            score_std=selection.score_std,
            training=selection.training,
            over_periods=selection.over_periods,
        )


def leading(selection: Selection) -> list[Candidate]:
    """The best candidate of each structure with something added to the joints' own terms, to compare with."""
    scores = dict(zip((c.name for c in selection.candidates), selection.score.tolist(), strict=True))
    more = [c for c in selection.candidates if c.variant != "independent"]
    structures = dict.fromkeys(c.structure for c in more)
    return [min((c for c in more if c.structure == s), key=lambda c: scores[c.name]) for s in structures]


def named(selection: Selection, fit: str) -> list[Candidate]:
    """The best candidate of the variant and estimator that the settings name, where they name one.

    What a mechanism can have is found from the best of its variant, however that is estimated.
    """
    variant, _, estimator = fit.rpartition(".")
    wanted = [i for i, c in enumerate(selection.candidates) if c.variant == variant]
    own = [i for i in wanted if estimator in (selection.candidates[i].estimator, "consistent")]
    return [selection.candidates[min(own, key=lambda i: float(selection.score[i]))]] if own else []


def possible(
    candidate: Candidate,
    found: Sequence[tuple[Model, Library, BlockEstimate]],
    robot: Robot,
    reaches: dict[str, Reach],
) -> Iterator[Fit | Diagnostic]:
    """A candidate's parameters held to what some mechanism has, and what that costs of how well they fit."""
    name = f"{candidate.variant}.{candidate.estimator}"
    for (model, library, free), ridge in zip(found, candidate.ridges(), strict=True):
        cells = library.by_block.columns(library.columns(candidate.friction, reaches))
        try:
            made = held(model, library, cells.of(np.ones(len(cells.gram), np.bool_)), ridge, free)
        except NotIdentifiable as error:
            said = f"{model.group}: {candidate.variant}.consistent is left out: {error}"
            yield diagnostic("choose", model.group, "warning", said)
            continue
        yield fitted(candidate, "consistent", model, library, made.estimate)
        if made.excess > NOTHING:
            units = [robot.joint(effort).unit("{effort}") for effort in model.efforts]
            each = zip(model.efforts, made.rmse, made.rmse_free, units, strict=True)
            costs = ", ".join(f"{rmse:.3g} for {before:.3g} {unit} of {joint}" for joint, rmse, before, unit in each)
            said = (
                f"{model.group}: no mechanism has the parameters of {name}; those that one can have (consistent) leave"
            )
            yield diagnostic("choose", model.group, "note", f"{said} {costs} where fitted, root mean square")


def fitted(candidate: Candidate, estimator: str, model: Model, library: Library, estimate: BlockEstimate) -> Fit:
    """Parameters of a candidate, from all logs."""
    about = model.parameters
    return Fit(
        group=model.group,
        model=candidate.variant,
        estimator=estimator,
        logs=tuple(log.records[0].log for log in library.logs),
        periods=0,
        correlated_lags=0,
        parameter=np.array([parameter.name for parameter in about], object),
        phi=np.array([parameter.typst for parameter in about], object),
        unit=np.array([parameter.unit for parameter in about], object),
        scale=np.array([parameter.scale for parameter in about]),
        positive=np.array([parameter.positive for parameter in about], float),
        **estimate._asdict(),
    )


def apply(motion: Motion, fits: Iterable[Fit], robot: Robot, *, lowpass: float) -> Iterator[FrictionMap]:
    """One FrictionMap per log that tells of friction, joint and model of the joint by itself.

    Of a coupled arm the rest of the effort depends on other joints, which a log of one does not hold.
    """
    if motion.role not in CHARTED_ROLES or motion.at_rest:
        return
    identified = Identified(robot, fits)
    for fit in identified.describing(motion.joint):
        if fit.estimator in CHARTED_ESTIMATORS and fit.model.startswith("independent"):
            yield charted(motion, fit, identified, lowpass)


def charted(motion: Motion, fit: Fit, identified: Identified, lowpass: float) -> FrictionMap:
    """tau - Phi_other theta_other, and Phi_friction theta_friction, as means over ranges of velocity."""
    Phi, known = identified.model(fit).regressor(recorded_motion(motion))
    friction = np.array(["friction" in str(name) for name in fit.parameter])
    left = smoothed(motion.tau, motion.segment, motion.rate, lowpass) - Phi[:, 0] @ np.where(friction, 0.0, fit.theta)
    modelled = Phi[:, 0] @ np.where(friction, fit.theta, 0.0)
    dq, ddq = motion.dq[known], motion.ddq[known]
    found = over_velocity(dq, ddq, np.column_stack([left, modelled])[known])
    return FrictionMap(
        log=motion.log,
        joint=motion.joint,
        model=fit.model,
        estimator=fit.estimator,
        role=motion.role,
        dq=found.dq,
        gaining=found.gaining.astype(int),
        tau_friction=found.mean[:, 0],
        tau_friction_std=found.std[:, 0],
        tau_friction_hat=found.mean[:, 1],
    )
