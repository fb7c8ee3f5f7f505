"""Predict the effort of logs that a fit has not seen, and score it; identification logs by leaving data out."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from pipeline.errors import NotIdentifiable
from pipeline.estimators import ESTIMATORS, estimator
from pipeline.estimators.folds import folds
from pipeline.estimators.regression import measured_motion, pose, predicted
from pipeline.maths.arrays import Booleans
from pipeline.maths.models.model import Model, Motion
from pipeline.maths.signals import averaging, harmonics
from pipeline.maths.signals.noise import model_error, noise_std, smoothed
from pipeline.maths.signals.path import SAME_PATH, likeness
from pipeline.maths.signals.smoothing import segments, share_passed
from pipeline.maths.signals.windows import outside
from pipeline.records import Column, CrossFit, Diagnostic, Fit, FittedPaths, Prediction, Signal, Trajectory, diagnostic
from pipeline.robots.models import independent
from pipeline.robots.robot import Joint
from pipeline.study import LogEntry


def run(
    signal: Signal,
    trajectory: Trajectory | None,
    paths: FittedPaths | None,
    fits: Iterable[Fit],
    cross_fits: Iterable[CrossFit],
    entry: LogEntry,
    joint: Joint,
    *,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """One Prediction per fit of the joint; the prediction of an identification log comes from refits without it.

    A joint at rest is not predicted: at standstill friction takes any value up to its Coulomb level.
    """
    if signal.at_rest:
        return
    model = independent(joint)
    if entry.role in ("validation", "contact"):
        free = outside(signal.t, entry.contact)
        if not free.any():
            name = f"{signal.log}/{joint.name}"
            said = f"{name}: its contact windows cover the whole log, so nothing is left to score a prediction on"
            yield diagnostic("predict", f"{signal.log}.{joint.name}", "warning", said)
            return
        motion = measured_motion(signal, lowpass)
        path = "same path" if paths is not None and follows(signal, paths) else "another path"
        for fit in fits:
            if fit.group == joint.name:
                tau_hat = predicted(model, fit.theta, motion)
                prediction = scored(signal, fit.model, fit.estimator, entry.role, tau_hat, free, lowpass)
                yield replace(prediction, path=path)
    elif trajectory is not None:
        own = [fit for fit in cross_fits if fit.group == joint.name]
        if own:
            yield from without_the_log(signal, trajectory, own, model, lowpass)
        else:
            yield from without_a_period(signal, trajectory, model, lowpass)


def follows(signal: Signal, paths: FittedPaths) -> bool:
    """Whether a recording follows a path that was fitted, on which the model's error repeats."""
    part = max(segments(signal.segment), key=lambda s: s.stop - s.start)
    each = [np.flatnonzero(paths.source == log) for log in dict.fromkeys(paths.source)]
    likenesses = [
        likeness(signal.t[part], signal.q[part], paths.q[rows], float(paths.period[rows[0]])) for rows in each
    ]
    return max(likenesses) > SAME_PATH


def without_the_log(
    signal: Signal, own: Trajectory, cross_fits: Iterable[CrossFit], model: Model, lowpass: float
) -> Iterator[Prediction]:
    """Predict a log from fits to other identification logs."""
    part = at(signal, whole(signal, own))
    motion = motion_at(own, part.t - own.t_start)
    everywhere = np.ones(len(part.t), dtype=bool)
    for fit in cross_fits:
        left_out = [str(names).split(", ") for names in fit.left_out]
        rows = [row for row, names in enumerate(left_out) if signal.log in names]
        if rows:
            number = len(left_out[rows[0]])
            scheme = "leave one log out" if number == 1 else f"leave {number} logs out"
            tau_hat = predicted(model, fit.theta[rows], motion)
            yield scored(part, fit.model, fit.estimator, scheme, tau_hat, everywhere, lowpass)


def without_a_period(
    signal: Signal, own: Trajectory, model: Model, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict each period of a log from fits to the other periods; only the effort is left out, not the path."""
    part = at(signal, whole(signal, own))
    since = part.t - own.t_start
    number = np.minimum((since / own.period + 1e-9).astype(int), own.periods - 1)
    group = np.array(folds(own.periods))[number]
    Phi = model.regressor(motion_at(own, since)).Phi[:, 0]
    tau_hat = {name: np.empty(len(since)) for name in ESTIMATORS}
    rests = averaging.left_out(part.t, part.tau, own.period, len(own.t), group)
    for out, rest in enumerate(rests):
        unseen = group == out
        kept = replace(own, tau=rest.mean, tau_var=rest.var, count=rest.counts)
        for name in list(tau_hat):
            try:
                tau_hat[name][unseen] = Phi[unseen] @ estimator(name)(pose(model, [kept])).theta
            except NotIdentifiable as error:
                yield not_predicted(signal, name, error)
                del tau_hat[name]
    for name, effort in tau_hat.items():
        yield scored(part, model.name, name, "leave one period out", effort, np.ones(len(since), dtype=bool), lowpass)


def not_predicted(signal: Signal, name: str, error: NotIdentifiable) -> Diagnostic:
    """Why an estimator has no leave-out score."""
    about = f"{signal.log}/{signal.joint}"
    said = f"{about}: {name} has no leave-out score, because a refit is not possible: {error}"
    return diagnostic("predict", f"{signal.log}.{signal.joint}", "note", said)


def whole(signal: Signal, own: Trajectory) -> Booleans:
    """Which samples belong to the whole periods that were averaged."""
    since = signal.t - own.t_start
    return np.asarray((since >= 0.0) & (since < own.periods * own.period - 0.5 / signal.rate))


def at(signal: Signal, which: Booleans) -> Signal:
    """Some of the samples of a signal."""
    columns = {name: getattr(signal, name)[which] for name in signal.columns()}
    return replace(signal, **columns)


def motion_at(own: Trajectory, since: Column) -> Motion:
    """The trajectory's motion at any time since its start, as one segment."""
    omega = 2 * np.pi / own.period
    c = harmonics.project(own.t, own.q, omega, own.harmonics)
    dc = harmonics.derivative(c, omega)
    ddc = harmonics.derivative(dc, omega)
    q, dq, ddq = (harmonics.evaluate(x, since, omega)[:, None] for x in (c, dc, ddc))
    return Motion(q, dq, ddq, 1.0 / own.rate, np.zeros(len(since), np.int64))


def scored(
    signal: Signal, model: str, name: str, scheme: str, tau_hat: Column, free: Booleans, lowpass: float
) -> Prediction:
    """A prediction with its scores, over the samples where nothing touched the robot."""
    tau, error = signal.tau[free], (signal.tau - tau_hat)[free]
    spread = tau - tau.mean()
    smooth, smooth_error = (
        smoothed(x, signal.segment, signal.rate, lowpass)[free] for x in (signal.tau, signal.tau - tau_hat)
    )
    rmse = float(np.sqrt(np.mean(error**2)))
    noise = noise_std(signal.tau - tau_hat, signal.segment, signal.rate, lowpass)
    beyond_noise, beyond_noise_std = model_error(smooth_error, noise * np.sqrt(share_passed(signal.rate, lowpass)))
    return Prediction(
        log=signal.log,
        joint=signal.joint,
        model=model,
        estimator=name,
        role=signal.role,
        scheme=scheme,
        path="same path" if scheme == "leave one period out" else "another path",
        rmse=rmse,
        nrmse=rmse / float(np.ptp(tau) or 1.0),
        r2=float(1 - error @ error / ((spread @ spread) or 1.0)),
        r2_ceiling=1.0 - noise**2 / (float(tau.var()) or 1.0),
        model_error=beyond_noise,
        model_error_std=beyond_noise_std,
        effort_rms=float(np.sqrt(np.mean(smooth**2))),
        relative_error=float(np.linalg.norm(smooth_error) / (np.linalg.norm(smooth) or 1.0)),
        t=signal.t,
        tau=signal.tau,
        tau_hat=tau_hat,
    )
