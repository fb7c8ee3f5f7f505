"""Predict the effort of logs that a fit has not seen, and score it; and model every joint along every log."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import Known, Regression
from davinci_forces.identification.joint_models import Along, at_samples, refits_of
from davinci_forces.identification.observations import averaged, observed, pose_samples
from davinci_forces.identification.regression import known_of, pose, predicted, recorded_motion, stands_still
from davinci_forces.identification.scores import Judge, folds, some
from davinci_forces.identification.used import ANOTHER_PATH, FALLBACK, SAME_PATH, Identified
from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.selection.cross_validation import BLOCKS
from davinci_forces.maths.signals.windows import outside
from davinci_forces.records import (
    Choice,
    CrossFit,
    Diagnostic,
    Fit,
    FittedPaths,
    JointModel,
    Motion,
    Prediction,
    Trajectory,
    diagnostic,
)
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study import LogEntry


def run(
    motions: Collection[Motion],
    trajectories: Iterable[Trajectory],
    fits: Iterable[Fit | CrossFit | Choice | FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """One Prediction per joint and fit; those of an identification log come from refits without some of it.

    A joint at rest is not predicted: at standstill friction takes any value up to its Coulomb level.  What the chosen
    model says of identification logs comes with the choice.
    """
    if entry.role in ("validation", "contact"):
        along = Along(Identified(robot, fits), motions)
        for motion in motions:
            if not motion.at_rest:
                yield from unseen(motion, along, entry, lowpass)
    elif entry.role == "identification":
        periods, identified = {t.joint: t for t in trajectories}, Identified(robot, fits)
        for motion in motions:
            if not motion.at_rest:
                refits = [fit for fit in identified.cross_fits if fit.group == motion.joint]
                yield from left_out(motion, periods.get(motion.joint), refits, robot.joint(motion.joint), lowpass)


def left_out(
    motion: Motion, own: Trajectory | None, refits: Sequence[CrossFit], joint: Joint, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of an identification log by refits without it, or of one log without some of it."""
    model, known = independent(joint), known_of(joint)
    if refits:
        yield from without_the_log(motion, own, refits, model, lowpass)
    elif own is not None:
        yield from without_a_period(motion, own, model, known, lowpass)
    else:
        yield from without_a_segment(motion, model, known, lowpass)


def unseen(motion: Motion, along: Along, entry: LogEntry, lowpass: float) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of a log that no parameter was fitted to, by its own fits and by the chosen one."""
    name, free = f"{motion.log}/{motion.joint}", outside(motion.t, entry.contact)
    if not free.any():
        said = f"{name}: its contact windows cover the whole log, so nothing is left to score a prediction on"
        yield diagnostic("predict", f"{motion.log}.{motion.joint}", "warning", said)
        return
    identified = along.identified
    own = [f for f in identified.fits if f.group == motion.joint and f.model == "independent"]
    chosen = identified.used(motion.joint, CHOSEN)
    if chosen is not None and not set(identified.model(chosen).joints) <= along.held(motion.joint):
        missing = f"{name}: the log does not hold the other joints that the chosen model needs"
        said = f"{missing}, so {FALLBACK} stands in for it; add their channels"
        yield diagnostic("predict", f"{motion.log}.{motion.joint}", "note", said)
        chosen = identified.used(motion.joint, FALLBACK)
    named = [(f.model, f.estimator, f) for f in own]
    if chosen is not None:
        named.append((CHOSEN, f"{chosen.model}.{chosen.estimator}", chosen))
    judge, path = Judge(motion, free, lowpass), identified.path(motion)
    for model, by, fit in named:
        yield judge.scored(model, by, entry.role, entry.role, path, along.tau_hat(fit, motion.joint))


def without_the_log(
    motion: Motion, own: Trajectory | None, cross_fits: Iterable[CrossFit], model: IndependentJoint, lowpass: float
) -> Iterator[Prediction]:
    """Predict a log from fits to other identification logs."""
    kept = whole_periods(motion.t, own) if own is not None else slice(None)
    part = some(motion, kept)
    judge, along = (
        Judge(part, part.standing == 0, lowpass, own.sigma_tau_white if own else None),
        recorded_motion(part),
    )
    for fit in cross_fits:
        left_out = [str(names).split(", ") for names in fit.left_out]
        rows = [row for row, names in enumerate(left_out) if motion.log in names]
        if rows:
            number = len(left_out[rows[0]])
            scheme = "leave one log out" if number == 1 else f"leave {number} logs out"
            tau_hat = predicted(model, fit.theta[rows], along)
            yield judge.scored(fit.model, fit.estimator, motion.role, scheme, ANOTHER_PATH, tau_hat)


def without_a_period(
    motion: Motion, own: Trajectory, model: IndependentJoint, known: Known, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict each period of a log from fits to the other periods; only the effort is left out, not the path."""
    part = some(motion, whole_periods(motion.t, own))
    runs, others = without_folds(part, own, model, known)
    Phi = model.regressor(recorded_motion(part)).Phi[:, 0]
    judge = Judge(part, part.standing == 0, lowpass, own.sigma_tau_white)
    for name in ESTIMATORS:
        try:
            thetas = [estimator(name)(regression).theta for regression in others]
        except NotIdentifiable as error:
            yield not_predicted(motion, name, error)
            continue
        tau_hat = np.concatenate([Phi[run] @ theta for run, theta in zip(runs, thetas, strict=True)])
        yield judge.scored(model.name, name, motion.role, "leave one period out", SAME_PATH, tau_hat)
        del tau_hat  # before there is the next, which in a long log is large


def without_folds(
    part: Motion, own: Trajectory, model: IndependentJoint, known: Known
) -> tuple[list[slice], list[Regression]]:
    """The samples of each fold of a log's whole periods, and the least squares problem of the others."""
    fold = fold_of(part.t, own)
    every, moving = pose(model, [own], known), ~stands_still(own)
    others = [
        replace(every, tau=rest.mean, tau_var=rest.var, periods=np.where(moving, rest.counts, 0))
        for rest in averaging.left_out(part.t, part.tau, own.period, len(own.t), fold)
    ]
    ends = np.searchsorted(fold, np.arange(len(others) + 1)).tolist()
    return [slice(*both) for both in pairwise(ends)], others


def fold_of(t: Array, own: Trajectory) -> Integers:
    """The fold of periods (N,) that each sample of whole periods is of, at these times [s]; it never falls."""
    period = np.minimum(((t - own.t_start) / own.period + 1e-9).astype(int), own.periods - 1)
    return np.asarray(np.array(folds(own.periods))[period])


def without_a_segment(
    own: Motion, model: IndependentJoint, known: Known, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict each sixth of a log that does not repeat from fits to the other five."""
    log = observed([own], (), lowpass, 0)
    Phi = model.regressor(log.motion).Phi[:, 0]
    judge = Judge(own, own.standing == 0, lowpass)
    for name in ESTIMATORS:
        tau_hat = np.empty(len(own))
        try:
            for block in range(BLOCKS):
                left = log.block == block
                tau_hat[left] = Phi[left] @ estimator(name)(pose_samples(model, log, ~left, known)[0]).theta
        except NotIdentifiable as error:
            yield not_predicted(own, name, error)
            continue
        yield judge.scored(model.name, name, "identification", "leave a segment out", ANOTHER_PATH, tau_hat)


def not_predicted(motion: Motion, name: str, error: NotIdentifiable) -> Diagnostic:
    """Why an estimator has no leave-out score."""
    about = f"{motion.log}/{motion.joint}"
    said = f"{about}: {name} has no leave-out score, because a refit is not possible: {error}"
    return diagnostic("predict", f"{motion.log}.{motion.joint}", "note", said)


def whole_periods(t: Array, own: Trajectory) -> slice:
    """The samples, at these times [s], of the periods that were averaged: a view of them takes no memory."""
    inside = np.flatnonzero(averaged(t, own))
    return slice(int(inside[0]), int(inside[-1]) + 1)


def apply(
    motions: Collection[Motion],
    predictions: Collection[Prediction],
    fits: Iterable[Fit | Choice | FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
) -> Iterator[JointModel | Diagnostic]:
    """One JointModel per joint that a fit describes; a joint without one says why.

    Raises
    ------
    PipelineError
        If there is no fit of the name that the settings say.
    """
    if entry.role == "friction":
        return
    identified, is_fitted = Identified(robot, fits), entry.role == "identification"
    along = Along(identified, motions)
    described = [joint for joint in along.joints if identified.describing(joint)]
    used = {joint: identified.used_along(joint, fit, along.held(joint)) for joint in described}
    refits = refits_of(predictions, {joint: own for joint, (own, _) in used.items()}, fit) if is_fitted else {}
    for motion in motions:
        about, name = f"{motion.log}.{motion.joint}.model", f"{motion.log}/{motion.joint}"
        if motion.joint not in used:
            said = "no identification log moves this joint, so its external effort is not tracked"
            yield diagnostic("predict", about, "note", f"{name}: {said}")
            continue
        own, stand_in = used[motion.joint]
        if stand_in:
            yield diagnostic("predict", about, "note", f"{name}: {stand_in}")
        terms = along.by(own, motion.joint)
        if terms["inertia"].min() <= 0:
            yield diagnostic("predict", about, "warning", not_positive(motion, own))
            continue
        path = SAME_PATH if is_fitted else identified.path(motion)
        refit = refits.get(motion.joint)
        yield JointModel(
            log=motion.log, joint=motion.joint, role=motion.role, stand_in=stand_in, path=path,
            scheme=refit.scheme if refit else "" if is_fitted else motion.role,
            path_unseen=refit.path if refit else "" if is_fitted else path,
            rate=motion.rate, at_rest=motion.at_rest, t=motion.t, q=motion.q, dq=motion.dq, ddq=motion.ddq,
            q_measured=motion.q_measured, dq_measured=motion.dq_measured, tau=motion.tau, segment=motion.segment,
            tau_hat_unseen=at_samples(refit, motion) if refit else np.full(len(motion), np.nan), **terms,
        )  # fmt: skip


def not_positive(motion: Motion, fit: Fit) -> str:
    """Why a joint is not tracked."""
    return (
        f"{motion.log}/{motion.joint}: the inertia of {fit.model}.{fit.estimator} is not positive along it, so no "
        f"motion follows from it and nothing is tracked; what `fit` says of {motion.joint} tells why: a motion that "
        "hardly excites it, a sign, other joints that move in the same logs, or what the model leaves out"
    )
