"""Predict the effort of logs that a fit has not seen, and score it; identification logs by leaving data out."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, starmap

import numpy as np

from pipeline.errors import NotIdentifiable
from pipeline.estimators import ESTIMATORS, estimator
from pipeline.estimators.folds import folds
from pipeline.estimators.known import known_of
from pipeline.estimators.observations import averaged, observed, pose_samples
from pipeline.estimators.paths import ANOTHER_PATH, SAME_PATH, follows
from pipeline.estimators.problem import Known
from pipeline.estimators.regression import measured_motion, of_joints, pose, predicted, stands_still
from pipeline.estimators.scores import Judge, some
from pipeline.estimators.used import describing, model_of, used
from pipeline.maths.arrays import Array, Booleans, Integers
from pipeline.maths.models.independent import IndependentJoint
from pipeline.maths.models.model import Motion
from pipeline.maths.selection.blocks import BLOCKS
from pipeline.maths.signals import averaging
from pipeline.maths.signals.windows import outside
from pipeline.records import (
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
from pipeline.records.predict import CHOSEN
from pipeline.robots.models import independent
from pipeline.robots.robot import Robot
from pipeline.study import LogEntry


def run(
    signals: Sequence[Signal],
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
    moving = [signal for signal in signals if not signal.at_rest]
    by_joint = {p.joint: p for p in paths}
    if entry.role in ("validation", "contact"):
        every, chosen = list(fits), list(choices)
        for signal in moving:
            own = by_joint.get(signal.joint)
            yield from unseen(signal, signals, own, every, chosen, entry, robot, lowpass)
    elif entry.role == "identification":
        periods, samples = {t.joint: t for t in trajectories}, {s.joint: s for s in smoothed}
        refits = list(cross_fits)
        for signal in moving:
            model, joint = independent(robot.joint(signal.joint)), signal.joint
            known = known_of(robot.joint(joint))
            own_fits = [fit for fit in refits if fit.group == joint]
            sampled = samples.get(joint)
            if own_fits:
                yield from without_the_log(signal, sampled, periods.get(joint), own_fits, model, lowpass)
            elif joint in periods:
                yield from without_a_period(signal, sampled, periods[joint], model, known, lowpass)
            elif sampled:
                yield from without_a_segment(sampled, model, known, lowpass)


def unseen(
    signal: Signal,
    signals: Sequence[Signal],
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
        tau_hat = along(fit, signal, signals, robot, lowpass)
        yield judge.scored(model, by, entry.role, entry.role, path, tau_hat)


def is_held(fit: Fit, signals: Sequence[Signal], robot: Robot) -> bool:
    """Whether a log holds all the joints, on one clock, that a fit needs the motion of."""
    lengths = {s.joint: len(s) for s in signals}
    needed = {lengths.get(joint, 0) for joint in model_of(robot, fit).joints}
    return len(needed) == 1 and 0 not in needed


def along(fit: Fit, signal: Signal, signals: Sequence[Signal], robot: Robot, lowpass: float) -> Array:
    """The effort (N,) that a fit gives for a joint along a log that holds all the joints it needs."""
    model, by_joint = model_of(robot, fit), {s.joint: s for s in signals}
    motion = of_joints([measured_motion(by_joint[joint], lowpass) for joint in model.joints])
    return predicted(model, fit.theta, motion, model.efforts.index(signal.joint))


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
    fold = fold_of(part.t, own)
    ends = np.searchsorted(fold, np.arange(fold[-1] + 2)).tolist()
    all_periods, moving = pose(model, [own], known), ~stands_still(own)
    others = [
        replace(all_periods, tau=rest.mean, tau_var=rest.var, periods=np.where(moving, rest.counts, 0))
        for rest in averaging.left_out(part.t, part.tau, own.period, len(own.t), fold)
    ]
    Phi = model.regressor(motion_of(signal, sampled, kept, lowpass)).Phi[:, 0]
    judge = Judge(part, moves(signal, sampled)[kept], lowpass, own.sigma_tau_white)
    for name in ESTIMATORS:
        tau_hat = np.empty(len(part))
        try:
            for left, regression in zip(starmap(slice, pairwise(ends)), others, strict=True):
                tau_hat[left] = Phi[left] @ estimator(name)(regression).theta
        except NotIdentifiable as error:
            yield not_predicted(signal, name, error)
            continue
        yield judge.scored(model.name, name, signal.role, "leave one period out", SAME_PATH, tau_hat)


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
        return at(measured_motion(signal, lowpass), which)
    q, dq, ddq = (x[:, None] for x in (sampled.q, sampled.dq, sampled.ddq))
    return at(Motion(q, dq, ddq, 1.0 / sampled.rate, sampled.segment), which)


def moves(signal: Signal, sampled: Smoothed | None) -> Booleans:
    """Where a joint does not stand still (N,), as far as that was looked for."""
    return sampled.standing == 0 if sampled is not None else np.ones(len(signal), np.bool_)


def whole_periods(t: Array, own: Trajectory) -> slice:
    """The samples, at these times [s], of the periods that were averaged: a view of them takes no memory."""
    inside = np.flatnonzero(averaged(t, own))
    return slice(int(inside[0]), int(inside[-1]) + 1)


def at(motion: Motion, which: slice) -> Motion:
    """A motion at some of its samples."""
    q, dq, ddq, T_s, segment, periodic = motion
    return Motion(q[which], dq[which], ddq[which], T_s, segment[which], periodic)
