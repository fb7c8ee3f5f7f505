"""Fit the parameters of every joint to all identification logs together, and without some, with every estimator."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pipeline.errors import NotIdentifiable
from pipeline.estimators import ESTIMATORS, estimator
from pipeline.estimators.folds import folds, refits
from pipeline.estimators.problem import Estimate, Regression
from pipeline.estimators.regression import averaged_motion, pose, predicted
from pipeline.maths.arrays import Array
from pipeline.maths.models.model import Model
from pipeline.maths.signals.path import SAME_PATH, most_different
from pipeline.records import CrossFit, Diagnostic, Fit, FittedPaths, MeasurementNoise, Residual, Trajectory, diagnostic
from pipeline.robots.models import independent
from pipeline.robots.robot import Robot

PATHS = 20  # at most, that a recording is compared with


def run(
    trajectories: Iterable[Trajectory], robot: Robot
) -> Iterator[Fit | CrossFit | FittedPaths | MeasurementNoise | Residual | Diagnostic]:
    """One Fit per joint and estimator; an estimator that cannot be used says why, and the rest goes on.

    A joint of several logs has a CrossFit, too, by which each of its logs can be predicted from others.
    """
    every = list(trajectories)
    for joint in robot.joints:
        own = [trajectory for trajectory in every if trajectory.joint == joint.name]
        if not own:
            continue
        model = independent(joint)
        regression = pose(model, own)
        for name in ESTIMATORS:
            try:
                estimate = estimator(name)(regression)
            except NotIdentifiable as error:
                yield diagnostic("fit", joint.name, "warning", f"{joint.name}: {name} is left out: {error}")
                continue
            if not has_positive_inertia(model, estimate.theta, own):
                finds = f"{joint.name}: {name} finds an inertia that is not positive"
                yield diagnostic("fit", joint.name, "warning", finds)
            yield summarised(own, model, name, regression, estimate)
            yield from residuals(own, model, name, estimate)
        if len(own) > 1:
            for name in ESTIMATORS:
                yield from cross_fits([t.log for t in own], model, name, regression)
        yield from fitted_paths(own)
        yield noise(own)


def has_positive_inertia(model: Model, theta: Array, trajectories: Sequence[Trajectory]) -> bool:
    """Whether M is positive definite along the trajectories; where it is not, no motion follows from the model."""
    return all(np.linalg.eigvalsh(model.inertia(theta, averaged_motion(t).q)).min() > 0 for t in trajectories)


def summarised(own: Sequence[Trajectory], model: Model, name: str, regression: Regression, estimate: Estimate) -> Fit:
    """A Fit with how well it describes the averaged periods."""
    residual = regression.tau - regression.Phi @ estimate.theta
    spread = regression.tau - regression.tau.mean()
    return Fit(
        group=model.group,
        model=model.name,
        estimator=name,
        logs=tuple(t.log for t in own),
        samples=len(regression.tau),
        periods=min(t.periods for t in own),
        mse=float(np.mean(residual**2)),
        r2=float(1 - residual @ residual / (spread @ spread)),
        condition=float(np.linalg.cond(regression.Phi)),
        hac_lags=estimate.hac_lags,
        parameter=np.array([parameter.name for parameter in model.parameters], object),
        phi=np.array([parameter.typst for parameter in model.parameters], object),
        unit=np.array([parameter.unit for parameter in model.parameters], object),
        theta=estimate.theta,
        theta_std=estimate.theta_std,
        theta_std_hac=estimate.theta_std_hac,
    )


def cross_fits(logs: Sequence[str], model: Model, name: str, regression: Regression) -> Iterator[CrossFit | Diagnostic]:
    """The parameters without each fold of the logs, and which logs no refit can do without."""
    fold = folds(len(logs))
    left_out, thetas = [], []
    for out, theta in enumerate(refits(regression, estimator(name))):
        names = ", ".join(log for log, own in zip(logs, fold, strict=True) if own == out)
        if isinstance(theta, NotIdentifiable):
            said = f"{model.group}: {name} has no leave-out score of {names}, because a refit is not possible: {theta}"
            yield diagnostic("fit", model.group, "note", said)
        else:
            left_out.append(names)
            thetas.append(theta)
    parameters, refitted = model.parameters, len(thetas)
    yield CrossFit(
        group=model.group,
        model=model.name,
        estimator=name,
        left_out=np.repeat(np.array(left_out, object), len(parameters)),
        parameter=np.array([parameter.name for parameter in parameters] * refitted, object),
        unit=np.array([parameter.unit for parameter in parameters] * refitted, object),
        theta=np.concatenate([[], *thetas]),
    )


def fitted_paths(own: Sequence[Trajectory]) -> Iterator[FittedPaths | Diagnostic]:
    """The paths of a joint's logs, or of many logs those that differ most."""
    joint = own[0].joint
    chosen, likeness = most_different([(t.t, t.q, t.period) for t in own], PATHS)
    if likeness < SAME_PATH:
        said = f"{joint}: its identification logs follow more than {PATHS} paths; recordings are compared with {PATHS}"
        yield diagnostic("fit", joint, "note", f"{said} that differ most, and may be said to follow another path")
    kept = [own[i] for i in chosen]
    yield FittedPaths(
        joint=joint,
        source=np.repeat(np.array([t.log for t in kept], object), [len(t) for t in kept]),
        period=np.repeat([t.period for t in kept], [len(t) for t in kept]),
        t=np.concatenate([t.t for t in kept]),
        q=np.concatenate([t.q for t in kept]),
    )


def noise(own: Sequence[Trajectory]) -> MeasurementNoise:
    """The noise between periods over all logs of a joint."""
    sigma_q, sigma_dq, sigma_tau = (
        float(np.sqrt(np.mean([getattr(t, name) ** 2 for t in own]))) for name in ("sigma_q", "sigma_dq", "sigma_tau")
    )
    return MeasurementNoise(own[0].joint, sigma_q, sigma_dq, sigma_tau)


def residuals(own: Sequence[Trajectory], model: Model, name: str, estimate: Estimate) -> Iterator[Residual]:
    """What the fit leaves of each log's averaged effort.  (6.54)"""
    for t in own:
        tau_hat = predicted(model, estimate.theta, averaged_motion(t))
        yield Residual(t.log, t.joint, model.name, name, t.rate, t=t.t, dq=t.dq, tau=t.tau, tau_hat=tau_hat)
