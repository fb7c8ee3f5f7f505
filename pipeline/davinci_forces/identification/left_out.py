"""Out-of-sample prediction of a joint, by fits to the other identification logs, periods or segments."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import Prior, Regression
from davinci_forces.identification.observations import averaged_samples, is_evaluated, observe, pose_samples
from davinci_forces.identification.regression import known_of, pose, recorded_motion, stands_still
from davinci_forces.identification.scores import Scorer, folds, select_samples
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.selection import PATH_BLOCKS
from davinci_forces.records import CrossFit, Diagnostic, Motion, Prediction, Trajectory, diagnostic
from davinci_forces.records.prediction import ANOTHER_PATH, SAME_PATH
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint


def left_out(
    motion: Motion, average: Trajectory | None, refits: Sequence[CrossFit], joint: Joint, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of an identification log by refits without that log, or without parts of a single log."""
    model, prior = independent(joint), known_of(joint)
    if refits:
        yield from without_the_log(motion, average, refits, model, lowpass)
    elif average is not None:
        yield from without_a_period(motion, average, model, prior, lowpass)
    else:
        yield from without_a_segment(motion, model, prior, lowpass)


def without_the_log(
    motion: Motion, average: Trajectory | None, cross_fits: Iterable[CrossFit], model: IndependentJoint, lowpass: float
) -> Iterator[Prediction]:
    """Predict a log from fits to other identification logs."""
    part = motion if average is None else select_samples(motion, whole_periods(motion.t, average))
    scorer = Scorer(part, is_evaluated(part), lowpass, average.sigma_tau_white if average else None)
    along = recorded_motion(part)
    for fit in cross_fits:
        left_out = [str(names).split(", ") for names in fit.left_out]
        rows = [row for row, names in enumerate(left_out) if motion.log in names]
        if rows:
            number = len(left_out[rows[0]])
            scheme = "leave one log out" if number == 1 else f"leave {number} logs out"
            tau_hat = np.ascontiguousarray(efforts(model, fit.theta[rows], along)[:, 0])
            yield scorer.score(fit.model, fit.estimator, motion.role, scheme, ANOTHER_PATH, tau_hat)


def without_a_period(
    motion: Motion, average: Trajectory, model: IndependentJoint, prior: Prior, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict each period of a log from fits to the other periods; the path of the period is not left out."""
    part = select_samples(motion, whole_periods(motion.t, average))
    runs, others = without_folds(part, average, model, prior)
    Phi = model.regressor(recorded_motion(part)).Phi[:, 0]
    scorer = Scorer(part, is_evaluated(part), lowpass, average.sigma_tau_white)
    for name in ESTIMATORS:
        try:
            thetas = [estimator(name)(regression).theta for regression in others]
        except NotIdentifiable as error:
            yield not_predicted(motion, name, error)
            continue
        tau_hat = np.concatenate([Phi[run] @ theta for run, theta in zip(runs, thetas, strict=True)])
        yield scorer.score(model.name, name, motion.role, "leave one period out", SAME_PATH, tau_hat)
        del tau_hat  # large in a long log: freed before the next is allocated


def without_folds(
    part: Motion, average: Trajectory, model: IndependentJoint, prior: Prior
) -> tuple[list[slice], list[Regression]]:
    """Return the samples of each fold of a log's whole periods, and the least squares problem of the other folds."""
    period = np.minimum(((part.t - average.t_start) / average.period + 1e-9).astype(int), average.periods - 1)
    fold, measured = np.array(folds(average.periods))[period], part.filled == 0
    problem, moving = pose(model, average, prior), ~stands_still(average)
    samples = part.t[measured], part.tau[measured], average.period, len(average.t), fold[measured]
    others = [
        replace(problem, tau=effort.mean, tau_var=effort.var, periods=np.where(moving, effort.counts, 0))
        for effort in averaging.left_out(*samples)
    ]
    ends = np.searchsorted(fold, np.arange(len(others) + 1)).tolist()
    return [slice(start, end) for start, end in pairwise(ends)], others


def without_a_segment(
    motion: Motion, model: IndependentJoint, prior: Prior, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict each sixth of a log that does not repeat from fits to the other five."""
    log = observe([motion], (), lowpass, 0)
    Phi = model.regressor(recorded_motion(motion)).Phi[:, 0]
    scorer = Scorer(motion, is_evaluated(motion), lowpass)
    for name in ESTIMATORS:
        tau_hat = np.empty(len(motion))
        try:
            for block in range(PATH_BLOCKS):
                out = log.block == block
                tau_hat[out] = Phi[out] @ estimator(name)(pose_samples(model, log, ~out, prior)[0]).theta
        except NotIdentifiable as error:
            yield not_predicted(motion, name, error)
            continue
        yield scorer.score(model.name, name, "identification", "leave a segment out", ANOTHER_PATH, tau_hat)


def not_predicted(motion: Motion, name: str, error: NotIdentifiable) -> Diagnostic:
    """Note that an estimator has no leave-out score, and why."""
    text = f"{motion.log}/{motion.joint}: {name} has no leave-out score, because a refit is not possible: {error}"
    return diagnostic("fit", f"{motion.log}.{motion.joint}", "note", text)


def whole_periods(t: Array, average: Trajectory) -> slice:
    """Return the samples of the averaged periods, at these times [s], as a slice, because its views take no memory."""
    inside = np.flatnonzero(averaged_samples(t, average))
    return slice(int(inside[0]), int(inside[-1]) + 1)
