"""What fits to the rest of the identification logs predict of a joint: of another log, period or segment."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import Known, Regression
from davinci_forces.identification.observations import averaged, observed, pose_samples
from davinci_forces.identification.regression import known_of, pose, predicted, recorded_motion, stands_still
from davinci_forces.identification.scores import Judge, folds, some
from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.selection import BLOCKS
from davinci_forces.records import (
    CrossFit,
    Diagnostic,
    Motion,
    Prediction,
    Trajectory,
    diagnostic,
)
from davinci_forces.records.prediction import ANOTHER_PATH, SAME_PATH
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint


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


def without_the_log(
    motion: Motion, own: Trajectory | None, cross_fits: Iterable[CrossFit], model: IndependentJoint, lowpass: float
) -> Iterator[Prediction]:
    """Predict a log from fits to other identification logs."""
    kept = whole_periods(motion.t, own) if own is not None else slice(None)
    part = some(motion, kept)
    judge = Judge(part, part.standing == 0, lowpass, own.sigma_tau_white if own else None)
    along = recorded_motion(part)
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
    return diagnostic("fit", f"{motion.log}.{motion.joint}", "note", said)


def whole_periods(t: Array, own: Trajectory) -> slice:
    """The samples, at these times [s], of the periods that were averaged: a view of them takes no memory."""
    inside = np.flatnonzero(averaged(t, own))
    return slice(int(inside[0]), int(inside[-1]) + 1)
