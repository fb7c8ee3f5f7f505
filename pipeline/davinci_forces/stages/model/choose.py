"""Search for the model of each joint by cross-validation, fit it to all logs, and map its friction over velocity."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.identification.candidates import Candidate, CandidatePart, candidates, reach_of
from davinci_forces.identification.chosen import (
    NEGLIGIBLE_EXCESS,
    BlockEstimate,
    Selection,
    better,
    fit_consistent,
    parameters,
    scores,
    select_candidate,
)
from davinci_forces.identification.identifiability import excite_command
from davinci_forces.identification.joint_models import Identified
from davinci_forces.identification.observations import Observed, is_evaluated, observe
from davinci_forces.identification.regression import parameter_columns, recorded_motion
from davinci_forces.identification.search import SearchResult, search_joints, searched_candidates
from davinci_forces.identification.unseen import predictions
from davinci_forces.maths.selection import standard_error
from davinci_forces.maths.signals.smoothing import lowpass_segments
from davinci_forces.maths.signals.velocity_map import over_velocity
from davinci_forces.records.model import Choice, Fit, FrictionMap, ModelSearch
from davinci_forces.records.prediction import CHOSEN, Prediction
from davinci_forces.records.record import Diagnostic, by_name, diagnostic, join_names
from davinci_forces.records.recordings import Average, Motion
from davinci_forces.robots.robot import Robot

STEP_COLUMNS = ("step_cutoff", "step_lag", "step_ridge", "parameters", "score")
MAPPED_ROLES = ("identification", "friction")
MAPPED_ESTIMATORS = ("lse", "ridge")  # without constraints
MAX_MSE_RATIO = 2.0  # of parameters that a mechanism can have to those without a positive inertia, which they replace


def run(
    motions: Annotated[Iterable[Motion], "identification"],
    averages: Iterable[Average],
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
) -> Iterator[Choice | ModelSearch | Fit | Prediction | Diagnostic]:
    """Choose one model for the whole arm, estimate its parameters, and predict the samples that each refit left out.

    If a log moves several joints and the robot has a chain, one model describes these joints together.  Joints
    that move only in other logs keep their own terms.  The fit that the setting `fit` names is also computed.
    """
    logs = logs_of(motions, averages, robot, lowpass)
    separate, arm = modelled_logs(logs, robot)
    if not separate:
        return
    if robot.chain is not None and any(log.is_moving.sum() > 1 for log in logs):
        yield from not_of_arm(logs, robot)
    yield from never_together(logs, robot)
    if arm:
        yield from no_shared_links(robot)
    reaches = {name: reach_of(joint_logs, name) for name, joint_logs in separate.items()}
    fixed = select_candidate(candidates(robot, separate, arm, reaches, len(logs)), len(logs))
    if fixed is None:
        message = "no model could be chosen: no candidate can be fitted with a part of the path left out"
        yield diagnostic("choose", "arm", "warning", f"{message}; record more of the path, or more periods")
        return
    searches = search_joints(robot, separate, arm, reaches, lowpass)
    searched = select_candidate(searched_candidates(robot, searches, separate, arm, len(logs)), len(logs))
    selection = better(fixed, searched)
    fitted = list(fits(selection.chosen, fixed.candidates, len(logs), robot, with_consistent=True))
    choices = list(choice(selection, logs, [record for record in fitted if isinstance(record, Fit)]))
    yield from choices
    yield from (search_record(search, selection.chosen) for search in searches)
    used = {record.group: record.estimator for record in choices if isinstance(record, Choice)}
    if not any(selection.physical) and {*used.values()} != {"consistent"}:
        message = "no candidate has a positive definite inertia along the paths, so the scores alone decide"
        where = "the report may name the cause beside all fits of each joint"
        yield diagnostic("choose", "arm", "warning", f"{message}; {where}")
    shown = (*best_of_structures(fixed), *best_of_setting(fixed, fit))
    named = {f"{c.variant}.{c.estimator}": c for c in (*shown, fixed.chosen)}
    by_variant = {c.variant: name for name, c in named.items()}
    for name, candidate in named.items():
        if name != "independent.lse":
            yield from fits(candidate, fixed.candidates, len(logs), robot, by_variant[candidate.variant] == name)
    yield from fitted
    for candidate in named.values():
        yield from predictions(candidate, logs)
    yield from predictions(selection.chosen, logs, used)


def fits(
    candidate: Candidate, others: Sequence[Candidate], count: int, robot: Robot, with_consistent: bool
) -> Iterator[Fit | Diagnostic]:
    """Fit a candidate to all logs; `with_consistent` also within the parameters that a mechanism can have."""
    estimates = list(parameters(candidate, count, others))
    yield from (fit_record(candidate, candidate.estimator, *pair, robot) for pair in estimates)
    if with_consistent and candidate.variant != "independent":
        yield from consistent_fits(candidate, estimates, robot)


def logs_of(motions: Iterable[Motion], averages: Iterable[Average], robot: Robot, lowpass: float) -> list[Observed]:
    """The joints of each log, in the robot's order; with several clocks, only joints on the first joint's clock."""
    joints, periods = [joint.name for joint in robot.joints], list(averages)
    logs: list[Observed] = []
    for log_records in by_name(motions, "log").values():
        ordered = sorted(log_records, key=lambda record: joints.index(record.joint))
        logs.append(observe([r for r in ordered if len(r) == len(ordered[0])], periods, lowpass, len(logs)))
    return logs


def modelled_logs(
    logs: Sequence[Observed], robot: Robot
) -> tuple[dict[str, tuple[Observed, ...]], tuple[Observed, ...]]:
    """The logs of each moving joint by itself, and, if joints move together, the logs that contain all joints."""
    whole = tuple(log for log in logs if len(log.records) == len(robot.joints) and log.is_moving.any())
    arm = whole if robot.chain is not None and any(log.is_moving.sum() > 1 for log in whole) else ()
    moving = [(r.joint, log.single_joint(i)) for log in arm or logs for i, r in enumerate(log.records) if not r.at_rest]
    separate = {joint.name: tuple(log for name, log in moving if name == joint.name) for joint in robot.joints}
    return {name: joint_logs for name, joint_logs in separate.items() if joint_logs}, arm


def not_of_arm(logs: Sequence[Observed], robot: Robot) -> Iterator[Diagnostic]:
    """Warn of the logs that the choice of a model of the whole arm leaves out, as they lack joints."""
    for log in logs:
        lacking = [joint.name for joint in robot.joints if joint.name not in log.joints]
        if lacking:
            first = log.records[0]
            text = f"{first.log}: no model of the whole arm is fitted to this log, as it lacks {join_names(lacking)}"
            remedy = f"to fit it, name their channels, on the clock of {first.joint}, also where a joint does not move"
            yield diagnostic("choose", "arm", "warning", f"{text}; {remedy}")


def never_together(logs: Sequence[Observed], robot: Robot) -> Iterator[Diagnostic]:
    """Warn of a robot with a chain if no log moves all joints together that the logs move."""
    moved = {record.joint for log in logs for record in log.records if not record.at_rest}
    joints = [joint.name for joint in robot.joints if joint.name in moved]
    if robot.chain is not None and len(joints) > 1 and not any(log.is_moving.sum() >= len(joints) for log in logs):
        text = f"arm: no identification log moves {join_names(joints)} together, so the effort that each needs for the "
        remedy = f"where they move together, record an excitation of all: {excite_command(robot, 'all')}"
        yield diagnostic("choose", "together", "warning", f"{text}motion of the others is not identified; {remedy}")


def no_shared_links(robot: Robot) -> Iterator[Diagnostic]:
    """Warn that efforts in A keep the joints of an arm from sharing the parameters of links."""
    if in_amperes := [joint.name for joint in robot.joints if joint.effort]:
        text = f"arm: the effort of {join_names(in_amperes)} is in A, so no model is tried whose joints share links"
        remedy = "it may err less; state torque_constant in [robot_overrides], and it is"
        yield diagnostic("choose", "arm.currents", "warning", f"{text}; {remedy}")


def choice(selection: Selection, logs: Sequence[Observed], fitted: Sequence[Fit]) -> Iterator[Choice | Diagnostic]:
    """One Choice per group of the chosen model, with all candidates and their scores.

    A motion that hardly excites the inertia may leave one that is not positive definite along the paths.  Parameters
    that a mechanism can have then take their place, if they describe the effort nearly as well.
    """
    chosen = selection.chosen
    for part, theta in zip(chosen.parts, chosen.parameters(), strict=True):
        group, estimator = part.model.group, chosen.estimator
        mse = {f.estimator: f.mse for f in fitted if f.group == group and part.is_physical(f.theta)}
        if estimator not in mse and mse.get("consistent", np.inf) < MAX_MSE_RATIO * scores(part, theta)["mse"]:
            estimator = "consistent"
            text = f"{group}: the inertia of {CHOSEN}.{chosen.estimator} is not positive along the fitted paths"
            follows = f"{CHOSEN}.consistent is used, with parameters that a mechanism can have"
            yield diagnostic("choose", f"{group}.inertia", "note", f"{text}, so {follows}; a faster motion excites it")
        yield Choice.like(
            selection,
            group=group,
            model=CHOSEN,
            friction=chosen.added,
            estimator=estimator,
            chosen=chosen.name,
            best=selection.best.name,
            logs=tuple(log.records[0].log for log in logs),
            candidate=np.array([c.name for c in selection.candidates], object),
            variant=np.array([c.variant for c in selection.candidates], object),
            parameters=np.array([c.size for c in selection.candidates]),
            **selection.scores,
        )


def search_record(search: SearchResult, candidate: Candidate) -> ModelSearch:
    """The steps of the search for the model of a joint, and whether the chosen candidate has its terms."""
    steps, chosen = search.steps, search.chosen
    parts = [part for part in candidate.parts if search.joint in part.model.efforts]
    used = candidate.name.startswith("searched") and parts[0].is_coupled == (search.structure == "coupled")
    return ModelSearch.like(
        search,
        chosen.processing,
        ridge=chosen.strength,
        term=tuple(term.name for term in chosen.terms),
        term_scale=tuple(term.scale for term in chosen.terms),
        used=int(used),
        chosen_step=steps.index(chosen),
        step=np.array([step.name for step in steps], object),
        **dict(
            zip(STEP_COLUMNS, np.array([(*s.processing, s.strength, s.size, s.score) for s in steps]).T, strict=True)
        ),
        score_std=np.array([standard_error(step.errors, search.best.errors) for step in steps]),
    )


def best_of_structures(selection: Selection) -> list[Candidate]:
    """The best candidate of each structure that adds to the joints' own terms, for comparison."""
    more = [c for c in selection.candidates if c.variant != "independent"]
    structures = dict.fromkeys(c.structure for c in more)
    return [min((c for c in more if c.structure == s), key=selection.score_of) for s in structures]


def best_of_setting(selection: Selection, fit: str) -> list[Candidate]:
    """The best candidate of the variant and estimator that the setting `fit` names, if there is one.

    Consistent parameters are computed from the best candidate of their variant, with any estimator.
    """
    variant, _, estimator = fit.rpartition(".")
    matching = [c for c in selection.candidates if c.variant == variant and estimator in (c.estimator, "consistent")]
    return [min(matching, key=selection.score_of)] if matching else []


def consistent_fits(
    candidate: Candidate, estimates: Sequence[tuple[CandidatePart, BlockEstimate]], robot: Robot
) -> Iterator[Fit | Diagnostic]:
    """Constrain the parameters of a candidate to be physically consistent, and state how much worse they fit."""
    name = f"{candidate.variant}.{candidate.estimator}"
    for part, free in estimates:
        model = part.model
        try:
            estimate, rmse, rmse_free, excess = fit_consistent(part, free)
        except (NotIdentifiable, np.linalg.LinAlgError) as error:
            message = f"{model.group}: {candidate.variant}.consistent is left out: {error}"
            yield diagnostic("choose", model.group, "note", message)
            continue
        yield fit_record(candidate, "consistent", part, estimate, robot)
        if excess > NEGLIGIBLE_EXCESS:
            units = [robot.joint(effort).unit("{effort}") for effort in model.efforts]
            errors = zip(model.efforts, rmse, rmse_free, units, strict=True)
            costs = ", ".join(f"{x:.3g} {unit} of {j} ({100 * (x / y - 1):+.2g} %)" for j, x, y, unit in errors)
            message = f"{model.group}: no mechanism has the parameters of the fit {name}"
            follows = f"to simulate, use {candidate.variant}.consistent, whose error where fitted is {costs}"
            yield diagnostic("choose", model.group, "note", f"{message}; {follows}")


def fit_record(candidate: Candidate, estimator: str, part: CandidatePart, estimate: BlockEstimate, robot: Robot) -> Fit:
    """The Fit of a part of a candidate to all logs."""
    model, log = part.model, part.library.logs[0]
    bodies = None if any(joint.effort for joint in robot.joints) else robot.bodies  # in A, their factor is unknown
    processing = [log.processing[log.joints.index(effort)] for effort in model.efforts]
    return Fit.like(
        estimate,
        group=model.group,
        model=candidate.variant,
        estimator=estimator,
        structure="coupled" if part.is_coupled else "independent",
        cutoff=tuple(p.cutoff for p in processing),
        effort_lag=tuple(p.effort_lag for p in processing),
        logs=tuple(log.records[0].log for log in part.library.logs),
        periods=0,
        correlated_lags=0,
        **parameter_columns(model, bodies),
    )


def apply(motion: Motion, fits: Iterable[Fit], robot: Robot, *, lowpass: float) -> Iterator[FrictionMap]:
    """Map friction over velocity, one FrictionMap per log, moving joint and model of the joint by itself.

    Coupled models are left out: their effort depends on other joints, which a log of one joint does not hold.
    """
    if motion.role not in MAPPED_ROLES or motion.at_rest:
        return
    identified = Identified(robot, fits)
    for fit in identified.fits_of(motion.joint):
        if fit.estimator in MAPPED_ESTIMATORS and fit.model.startswith("independent"):
            yield friction_map(motion, fit, identified, lowpass)


def friction_map(motion: Motion, fit: Fit, identified: Identified, lowpass: float) -> FrictionMap:
    """tau - Phi_other theta_other, and Phi_friction theta_friction, as means over ranges of velocity."""
    Phi, valid = identified.model(fit).regressor(recorded_motion(motion))
    is_friction = np.array(["friction" in str(name) for name in fit.parameter])
    tau, theta = lowpass_segments(motion.tau, motion.segment, motion.rate, lowpass), fit.theta
    measured = tau - Phi[:, 0] @ np.where(is_friction, 0.0, theta)
    modelled = Phi[:, 0] @ np.where(is_friction, theta, 0.0)
    valid &= is_evaluated(motion)
    means = over_velocity(motion.dq[valid], motion.ddq[valid], np.column_stack([measured, modelled])[valid])
    return FrictionMap.like(
        means,
        fit,
        motion,
        tau_friction=means.mean[:, 0],
        tau_friction_std=means.std[:, 0],
        tau_friction_hat=means.mean[:, 1],
    )
