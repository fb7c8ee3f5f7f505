"""Fit the parameters of every joint to all identification logs together, and without some, with every estimator."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Annotated, NamedTuple

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import NOTHING, Estimate, Known, Regression, Search
from davinci_forces.identification.identifiability import (
    advice,
    flat,
    hardly_described,
    inertia_at_fault,
    listed,
    moving_with,
    not_seen,
    together,
)
from davinci_forces.identification.left_out import left_out
from davinci_forces.identification.observations import observed, pose_samples
from davinci_forces.identification.regression import joined, known_of, pose
from davinci_forces.identification.scores import folds, refits
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Told, told
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.periods.shift import SAME_PATH, most_different
from davinci_forces.records import (
    Column,
    CrossFit,
    Diagnostic,
    Fit,
    FittedPaths,
    Guess,
    Identifiability,
    MeasurementNoise,
    Motion,
    Prediction,
    Residual,
    SwarmSearch,
    Trajectory,
    diagnostic,
)
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study import LogEntry

PATHS = 20  # at most, that a recording is compared with


class Part(NamedTuple):
    """What one log tells of a joint: an averaged period, or low-passed samples of a motion that does not repeat."""

    log: str
    rate: float
    periods: int
    period: float  # [s], or the duration of what does not repeat
    noise: tuple[float, float, float]  # standard deviations of q, dq and tau
    t: Column
    q: Column
    dq: Column
    regression: Regression


def run(
    trajectories: Iterable[Trajectory],
    motions: Annotated[Iterable[Motion], "identification"],
    robot: Robot,
    *,
    lowpass: float,
) -> Iterator[
    Fit | CrossFit | FittedPaths | Guess | Identifiability | MeasurementNoise | Residual | SwarmSearch | Diagnostic
]:
    """One Fit per joint and estimator; an estimator that cannot be used says why, and the rest goes on.

    A joint of several logs has a CrossFit, too, by which each of its logs can be predicted from others.
    """
    averaged, moving, unaveraged = list(trajectories), list[tuple[str, str]](), list[Motion]()
    repeating = {(t.log, t.joint) for t in averaged}
    for motion in motions:
        if not motion.at_rest:
            moving.append((motion.log, motion.joint))
            unaveraged += [motion] if moving[-1] not in repeating else []
    for joint in robot.joints:
        model, prior = independent(joint), known_of(joint)
        parts = [repeated(model, t, prior) for t in averaged if t.joint == joint.name]
        parts += [unrepeated(model, motion, lowpass, prior) for motion in unaveraged if motion.joint == joint.name]
        if parts:
            others = moving_with(joint.name, [part.log for part in parts], moving)
            yield from of_joint(model, parts, robot, joint, others)


def apply(
    motions: Collection[Motion],
    trajectories: Iterable[Trajectory],
    cross_fits: Iterable[CrossFit],
    entry: LogEntry,
    robot: Robot,
    *,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """One Prediction per estimator and joint of an identification log, by refits without some of it."""
    if entry.role != "identification":
        return
    periods, refits = {t.joint: t for t in trajectories}, list(cross_fits)
    for motion in motions:
        if not motion.at_rest:
            others = [fit for fit in refits if fit.group == motion.joint]
            yield from left_out(motion, periods.get(motion.joint), others, robot.joint(motion.joint), lowpass)


def of_joint(
    model: IndependentJoint, parts: Sequence[Part], robot: Robot, joint: Joint, others: Sequence[str]
) -> Iterator[
    Fit | CrossFit | FittedPaths | Guess | Identifiability | MeasurementNoise | Residual | SwarmSearch | Diagnostic
]:
    """The fits of one joint, what they leave, and what its logs have in common; `others` move in them, too."""
    regression = joined([part.regression for part in parts])
    estimates: dict[str, Estimate] = {}
    for name in ESTIMATORS:
        try:
            estimate = estimator(name)(regression)
        except NotIdentifiable as error:
            yield diagnostic("fit", model.group, "warning", f"{model.group}: {name} is left out: {error}")
            continue
        estimates[name] = estimate
        yield summarised(parts, model, name, regression, estimate)
        yield from residuals(parts, model, name, estimate)
        yield from (swarm_search(model, name, search) for search in estimate.searches)
    yield from identifiability(model, parts, regression, estimates, robot, joint, others)
    yield from held_back(model.group, regression, estimates, joint.unit("{effort}"))
    if len(parts) > 1:
        for name in ESTIMATORS:
            yield from cross_fits([part.log for part in parts], model, name, regression)
    yield from guesses(model, regression)
    yield from fitted_paths(model.group, parts)
    yield noise(model.group, parts)


def identifiability(
    model: IndependentJoint,
    parts: Sequence[Part],
    regression: Regression,
    estimates: dict[str, Estimate],
    robot: Robot,
    joint: Joint,
    others: Sequence[str],
) -> Iterator[Identifiability | Diagnostic]:
    """What the logs of a joint tell of its parameters, and whose inertia is not positive, and why."""
    plain = estimates.get("lse")
    if plain is None:
        return
    seen = told(regression.triangle)
    names = [parameter.name for parameter in model.parameters]
    wanting = (*together(names, seen), *not_seen(regression, plain))
    yield summary_of(model, names, seen, regression, plain, advice(robot, joint, wanting))
    wrong = [name for name, estimate in estimates.items() if not has_positive_inertia(model, estimate.theta, parts)]
    if wrong:
        least = plain if "lse" in wrong else estimates[wrong[0]]
        verb = "finds" if len(wrong) == 1 else "find"
        why = inertia_at_fault(robot, joint, least, seen, others)
        said = f"{model.group}: {listed(wrong)} {verb} an inertia that is not positive: {why}"
        yield diagnostic("fit", model.group, "warning", said)
    if said := hardly_described(joint, explained(regression, plain), others):
        yield diagnostic("fit", model.group, "warning", f"{model.group}: {said}")


def held_back(group: str, regression: Regression, estimates: dict[str, Estimate], unit: str) -> Iterator[Diagnostic]:
    """What it costs that parameters are those of some mechanism, where least squares' are not."""
    if "lse" not in estimates or "consistent" not in estimates:
        return
    signs = regression.known.signs(len(regression.names))
    wrong = [name for name, x, known in zip(regression.names, estimates["lse"].theta, signs, strict=True)
             if known and x < 0]  # fmt: skip
    if wrong:
        rmse, before = (
            np.sqrt(np.mean((regression.tau - regression.Phi @ estimates[name].theta) ** 2))
            for name in ("consistent", "lse")
        )
        said = f"{group}: no mechanism has a negative {listed(wrong)}, as lse finds; parameters that one can have"
        cost = f"leave {rmse:.3g} for {before:.3g} {unit} of the effort, root mean square"
        yield diagnostic("fit", group, "note", f"{said} (consistent) {cost}")


def summary_of(
    model: IndependentJoint, names: Sequence[str], seen: Told, regression: Regression, plain: Estimate, next_motion: str
) -> Identifiability:
    """The correlations of a joint's parameters, and what follows from them."""
    p = len(names)
    return Identifiability(
        group=model.group,
        model=model.name,
        scaled_condition=seen.condition,
        together=tuple(together(names, seen)),
        not_seen=tuple(not_seen(regression, plain)),
        advice=next_motion,
        parameter=np.repeat(np.array(names, object), p),
        beside=np.tile(np.array(names, object), p),
        correlation=flat(seen),
    )


def left(regression: Regression, estimate: Estimate) -> Array:
    """What a fit leaves of the effort that it was made from."""
    return np.asarray((regression.tau - regression.Phi @ estimate.theta)[regression.periods > 0])


def explained(regression: Regression, estimate: Estimate) -> float:
    """The share of the effort's variance that a fit explains, R2."""
    tau, residual = regression.tau[regression.periods > 0], left(regression, estimate)
    spread = tau - tau.mean()
    return float(1 - residual @ residual / (spread @ spread))


def repeated(model: IndependentJoint, t: Trajectory, known: Known = NOTHING) -> Part:
    """An averaged period."""
    sigmas = (t.sigma_q, t.sigma_dq, t.sigma_tau)
    return Part(t.log, t.rate, t.periods, t.period, sigmas, t.t, t.q, t.dq, pose(model, [t], known))


def unrepeated(model: IndependentJoint, record: Motion, lowpass: float, known: Known) -> Part:
    """Samples, motion and effort through one low-pass."""
    regression, kept = pose_samples(model, observed([record], (), lowpass, 0), known=known)
    step = float(np.median(np.diff(kept))) if len(kept) > 1 else 1.0
    t, q, dq = (x[kept] for x in (record.t, record.q, record.dq))
    sigmas = (record.sigma_q, record.sigma_dq, record.sigma_tau)
    return Part(record.log, record.rate / step, 1, float(t[-1] - t[0]), sigmas, t, q, dq, regression)


def has_positive_inertia(model: IndependentJoint, theta: Array, parts: Sequence[Part]) -> bool:
    """Whether M is positive definite along the trajectories; where it is not, no motion follows from the model."""
    return all(np.linalg.eigvalsh(model.inertia(theta, part.q[:, None])).min() > 0 for part in parts)


def summarised(
    parts: Sequence[Part], model: IndependentJoint, name: str, regression: Regression, estimate: Estimate
) -> Fit:
    """A Fit with how well it describes what it was fitted to."""
    residual = left(regression, estimate)
    return Fit(
        group=model.group,
        model=model.name,
        estimator=name,
        logs=tuple(part.log for part in parts),
        samples=len(regression.tau),
        periods=min(part.periods for part in parts),
        mse=float(np.mean(residual**2)),
        r2=explained(regression, estimate),
        condition=float(np.linalg.cond(regression.Phi)),
        correlated_lags=estimate.correlated_lags,
        parameter=np.array([parameter.name for parameter in model.parameters], object),
        phi=np.array([parameter.typst for parameter in model.parameters], object),
        unit=np.array([parameter.unit for parameter in model.parameters], object),
        scale=np.array([parameter.scale for parameter in model.parameters]),
        positive=np.array([parameter.positive for parameter in model.parameters], float),
        theta=estimate.theta,
        theta_std=estimate.theta_std,
        theta_std_classical=estimate.theta_std_classical,
    )


def guesses(model: IndependentJoint, regression: Regression) -> Iterator[Guess]:
    """What the robot's tables make of the parameters, where it has any.  (6.7), (6.10), (6.13)"""
    theta = regression.known.guess
    if theta is None:
        return
    residual = regression.tau - regression.Phi @ theta
    yield Guess(
        group=model.group,
        mse=float(np.mean(residual**2)),
        parameter=np.array([parameter.name for parameter in model.parameters], object),
        unit=np.array([parameter.unit for parameter in model.parameters], object),
        theta=theta,
    )


def swarm_search(model: IndependentJoint, name: str, search: Search) -> SwarmSearch:
    """A search with its history.  Fig 6.14"""
    return SwarmSearch(
        group=model.group,
        model=model.name,
        estimator=name,
        walls=search.walls,
        seed=search.seed,
        particles=search.particles,
        searched=search.searched,
        swarms=search.swarms,
        iterations=len(search.history),
        excess=search.excess,
        mse=float(search.history[-1]),
        best_mse=search.history,
    )


def cross_fits(
    logs: Sequence[str], model: IndependentJoint, name: str, regression: Regression
) -> Iterator[CrossFit | Diagnostic]:
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


def fitted_paths(joint: str, parts: Sequence[Part]) -> Iterator[FittedPaths | Diagnostic]:
    """The paths of a joint's logs, or of many logs those that differ most."""
    chosen, likeness = most_different([(part.t, part.q, part.period) for part in parts], PATHS)
    if likeness < SAME_PATH:
        said = f"{joint}: its identification logs follow more than {PATHS} paths; recordings are compared with {PATHS}"
        yield diagnostic("fit", joint, "note", f"{said} that differ most, and may be said to follow another path")
    kept = [parts[i] for i in chosen]
    yield FittedPaths(
        joint=joint,
        source=np.repeat(np.array([part.log for part in kept], object), [len(part.t) for part in kept]),
        period=np.repeat([part.period for part in kept], [len(part.t) for part in kept]),
        t=np.concatenate([part.t for part in kept]),
        q=np.concatenate([part.q for part in kept]),
    )


def noise(joint: str, parts: Sequence[Part]) -> MeasurementNoise:
    """The noise between periods, or beyond the low-pass, over all logs of a joint."""
    sigma_q, sigma_dq, sigma_tau = np.sqrt(np.mean([np.square(part.noise) for part in parts], axis=0)).tolist()
    return MeasurementNoise(joint, sigma_q, sigma_dq, sigma_tau)


def residuals(parts: Sequence[Part], model: IndependentJoint, name: str, estimate: Estimate) -> Iterator[Residual]:
    """What the fit leaves of each log's effort.  (6.54)"""
    for part in parts:
        tau_hat, tau = part.regression.Phi @ estimate.theta, part.regression.tau
        yield Residual(part.log, model.group, model.name, name, part.rate, part.t, part.dq, tau, tau_hat)
