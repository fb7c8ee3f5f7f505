"""Predict the effort of logs that a fit has not seen, and score it; identification logs by leaving data out."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import Known, Regression
from davinci_forces.identification.driving import Motions, motions_of
from davinci_forces.identification.folds import folds
from davinci_forces.identification.known import known_of
from davinci_forces.identification.observations import averaged, observed, pose_samples
from davinci_forces.identification.paths import ANOTHER_PATH, SAME_PATH, follows
from davinci_forces.identification.regression import measured_motion, of_joints, pose, predicted, stands_still
from davinci_forces.identification.scores import Judge, some
from davinci_forces.identification.used import describing, model_of, used
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.memory import cut
from davinci_forces.maths.models.model import Motion
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.selection.cross_validation import BLOCKS
from davinci_forces.maths.signals.windows import outside
from davinci_forces.records import (
    Choice,
    CrossFit,
    Diagnostic,
    Fit,
    FittedPaths,
    Prediction,
    Signal,
    Smoothed,
    Trajectory,
    diagnostic,
)  # fmt: skip
from davinci_forces.records.predict import CHOSEN
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study import LogEntry


def run(
    signals: Collection[Signal],
    smoothed: Iterable[Smoothed],
    trajectories: Iterable[Trajectory],
    paths: Iterable[FittedPaths],
    fits: Iterable[Fit],
    cross_fits: Iterable[CrossFit],
    choices: Iterable[Choice],
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
        by_joint, every, chosen = {p.joint: p for p in paths}, list(fits), list(choices)
        recorded = list(signals)
        motions = motions_of(recorded, lowpass)
        for signal in recorded:
            if not signal.at_rest:
                path = by_joint.get(signal.joint)
                yield from unseen(signal, recorded, motions, path, every, chosen, entry, robot, lowpass)
    elif entry.role == "identification":
        periods, samples = {t.joint: t for t in trajectories}, {s.joint: s for s in smoothed}
        refits = list(cross_fits)
        for signal in signals:
            if not signal.at_rest:
                own, sampled = periods.get(signal.joint), samples.get(signal.joint)
                yield from left_out(signal, sampled, own, refits, robot.joint(signal.joint), lowpass)


def left_out(
    signal: Signal,
    sampled: Smoothed | None,
    own: Trajectory | None,
    cross_fits: Sequence[CrossFit],
    joint: Joint,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of an identification log by refits without it, or of one log without some of it."""
    model, known = independent(joint), known_of(joint)
    refits = [fit for fit in cross_fits if fit.group == joint.name]
    if refits:
        yield from without_the_log(signal, sampled, own, refits, model, lowpass)
    elif own is not None:
        yield from without_a_period(signal, sampled, own, model, known, lowpass)
    elif sampled is not None:
        yield from without_a_segment(sampled, model, known, lowpass)


def unseen(
    signal: Signal,
    signals: Sequence[Signal],
    motions: Motions,
    paths: FittedPaths | None,
    fits: Sequence[Fit],
    choices: Sequence[Choice],
    entry: LogEntry,
    robot: Robot,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of a log that no parameter was fitted to, by its own fits and by the chosen one."""
    name, free = f"{signal.log}/{signal.joint}", outside(signal.t, entry.contact)
    if not free.any():
        said = f"{name}: its contact windows cover the whole log, so nothing is left to score a prediction on"
        yield diagnostic("predict", f"{signal.log}.{signal.joint}", "warning", said)
        return
    path = SAME_PATH if paths is not None and follows(signal, paths) else ANOTHER_PATH
    own = [f for f in fits if f.group == signal.joint and f.model == "independent"]
    chosen = used(robot, describing(robot, fits, signal.joint), choices, signal.joint, CHOSEN)
    if chosen is not None and not is_held(chosen, signals, robot):
        missing = f"{name}: the log does not hold the other joints that the chosen model needs"
        said = f"{missing}, so independent.lse stands in for it; add their channels"
        yield diagnostic("predict", f"{signal.log}.{signal.joint}", "note", said)
        chosen = next((f for f in own if f.estimator == "lse"), None)
    named = [(f.model, f.estimator, f) for f in own]
    if chosen is not None:
        named.append((CHOSEN, f"{chosen.model}.{chosen.estimator}", chosen))
    judge = Judge(signal, free, lowpass)
    for model, by, fit in named:
        yield judge.scored(model, by, entry.role, entry.role, path, along(fit, signal.joint, motions, robot))


def is_held(fit: Fit, signals: Sequence[Signal], robot: Robot) -> bool:
    """Whether a log holds all the joints, on one clock, that a fit needs the motion of."""
    lengths = {s.joint: len(s) for s in signals}
    needed = {lengths.get(joint, 0) for joint in model_of(robot, fit).joints}
    return len(needed) == 1 and 0 not in needed


def along(fit: Fit, joint: str, motions: Motions, robot: Robot) -> Array:
    """The effort (N,) that a fit gives for a joint along a log that holds all the joints it needs."""
    model = model_of(robot, fit)
    return predicted(model, fit.theta, of_joints([motions[name] for name in model.joints]), model.efforts.index(joint))


def without_the_log(
    signal: Signal,
    sampled: Smoothed | None,
    own: Trajectory | None,
    cross_fits: Iterable[CrossFit],
    model: IndependentJoint,
    lowpass: float,
) -> Iterator[Prediction]:
    """Predict a log from fits to other identification logs."""
    kept = whole_periods(signal.t, own) if own is not None else slice(None)
    motion = motion_of(signal, sampled, kept, lowpass)
    judge = Judge(some(signal, kept), moves(signal, sampled)[kept], lowpass, own.sigma_tau_white if own else None)
    for fit in cross_fits:
        left_out = [str(names).split(", ") for names in fit.left_out]
        rows = [row for row, names in enumerate(left_out) if signal.log in names]
        if rows:
            number = len(left_out[rows[0]])
            scheme = "leave one log out" if number == 1 else f"leave {number} logs out"
            tau_hat = predicted(model, fit.theta[rows], motion)
            yield judge.scored(fit.model, fit.estimator, signal.role, scheme, ANOTHER_PATH, tau_hat)


def without_a_period(
    signal: Signal,
    sampled: Smoothed | None,
    own: Trajectory,
    model: IndependentJoint,
    known: Known,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """Predict each period of a log from fits to the other periods; only the effort is left out, not the path."""
    kept = whole_periods(signal.t, own)
    part = some(signal, kept)
    runs, others = without_folds(part, own, model, known)
    Phi = model.regressor(motion_of(signal, sampled, kept, lowpass)).Phi[:, 0]
    judge = Judge(part, moves(signal, sampled)[kept], lowpass, own.sigma_tau_white)
    for name in ESTIMATORS:
        try:
            thetas = [estimator(name)(regression).theta for regression in others]
        except NotIdentifiable as error:
            yield not_predicted(signal, name, error)
            continue
        tau_hat = np.concatenate([Phi[run] @ theta for run, theta in zip(runs, thetas, strict=True)])
        yield judge.scored(model.name, name, signal.role, "leave one period out", SAME_PATH, tau_hat)
        del tau_hat  # before there is the next, which in a long log is large


def without_folds(
    part: Signal, own: Trajectory, model: IndependentJoint, known: Known
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
    own: Smoothed, model: IndependentJoint, known: Known, lowpass: float
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


def not_predicted(signal: Signal | Smoothed, name: str, error: NotIdentifiable) -> Diagnostic:
    """Why an estimator has no leave-out score."""
    about = f"{signal.log}/{signal.joint}"
    said = f"{about}: {name} has no leave-out score, because a refit is not possible: {error}"
    return diagnostic("predict", f"{signal.log}.{signal.joint}", "note", said)


def motion_of(signal: Signal, sampled: Smoothed | None, which: slice, lowpass: float) -> Motion:
    """The motion of a joint at some samples of a recording: as it was smoothed to choose a model by, if it was."""
    if sampled is None:
        return cut(measured_motion(signal, lowpass), which)
    q, dq, ddq = (x[:, None] for x in (sampled.q, sampled.dq, sampled.ddq))
    return cut(Motion(q, dq, ddq, 1.0 / sampled.rate, sampled.segment), which)


def moves(signal: Signal, sampled: Smoothed | None) -> Booleans:
    """Where a joint does not stand still (N,), as far as that was looked for."""
    return sampled.standing == 0 if sampled is not None else np.ones(len(signal), np.bool_)


def whole_periods(t: Array, own: Trajectory) -> slice:
    """The samples, at these times [s], of the periods that were averaged: a view of them takes no memory."""
    inside = np.flatnonzero(averaged(t, own))
    return slice(int(inside[0]), int(inside[-1]) + 1)
