"""Estimate the parameters of every joint, from all identification logs and from parts of them, by each estimator."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import NO_PRIOR, Estimate, Prior, Regression, Search, standard_errors
from davinci_forces.identification import identifiability
from davinci_forces.identification.candidates import Library, variants, with_every_term
from davinci_forces.identification.model_error import model_std
from davinci_forces.identification.observations import CellEquations, Observed, block_equations, observe, pose_samples
from davinci_forces.identification.regression import join_regressions, known_of, parameter_columns, pose
from davinci_forces.identification.scores import folds, refits
from davinci_forces.identification.unseen import left_out
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import analyse_columns
from davinci_forces.maths.models.independent import IndependentJoint, inertia_of
from davinci_forces.maths.periods.harmonics import largest_omitted
from davinci_forces.maths.periods.shift import SAME_PATH, most_different
from davinci_forces.maths.selection import side_by_side
from davinci_forces.maths.signals.standstill import speed_of
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean
from davinci_forces.records.model import (
    CrossFit,
    Fit,
    FittedPaths,
    Guess,
    Identifiability,
    MeasurementNoise,
    Residual,
    SwarmSearch,
)
from davinci_forces.records.prediction import Prediction
from davinci_forces.records.record import Column, Diagnostic, diagnostic, join_names
from davinci_forces.records.recordings import Motion, Spectrum, Trajectory
from davinci_forces.robots.models import Reach, independent, round_scale
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

MAX_PATHS = 20  # number of fitted paths with which a recording is compared


class Part(NamedTuple):
    """Data of one joint from one log: an averaged period, or low-passed samples of a motion without a period."""

    log: str
    rate: float
    periods: int
    period: float  # [s]; the duration of a motion without a period
    noise: tuple[float, float, float]  # std of q, dq and tau between periods, or of what the low-pass removes
    t: Column
    q: Column
    dq: Column
    regression: Regression
    source: Trajectory | Observed


def run(
    trajectories: Iterable[Trajectory],
    motions: Annotated[Iterable[Motion], "identification"],
    robot: Robot,
    spectra: Iterable[Spectrum] = (),
    *,
    lowpass: float,
) -> Iterator[
    Fit | CrossFit | FittedPaths | Guess | Identifiability | MeasurementNoise | Residual | SwarmSearch | Diagnostic
]:
    """Estimate one Fit per joint and estimator; a diagnostic says why an estimator cannot be used.

    A joint with several logs also gets a CrossFit, which predicts each log from fits to the other logs.
    """
    averaged, moving, unaveraged = list(trajectories), list[tuple[str, str]](), list[Motion]()
    all_spectra = list(spectra)
    repeating = {(t.log, t.joint) for t in averaged}
    for motion in motions:
        if not motion.at_rest:
            moving.append((motion.log, motion.joint))
            unaveraged += [motion] if moving[-1] not in repeating else []
    for joint in robot.joints:
        model, prior = independent(joint), known_of(joint)
        parts = [periodic_part(model, t, prior) for t in averaged if t.joint == joint.name]
        parts += [sampled_part(model, motion, lowpass, prior) for motion in unaveraged if motion.joint == joint.name]
        if parts:
            others = identifiability.moving_with(joint.name, [part.log for part in parts], moving)
            shares = [largest_omitted(s.amplitude, s.harmonics)[1] for s in all_spectra if s.joint == joint.name]
            yield from fit_joint(model, parts, robot, others, max(shares, default=0.0), lowpass)


def apply(
    motions: Collection[Motion],
    trajectories: Iterable[Trajectory],
    cross_fits: Iterable[CrossFit],
    entry: LogEntry,
    robot: Robot,
    *,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """Predict the effort of an identification log by refits without parts of the log, per estimator and joint."""
    if entry.role != "identification":
        return
    periods, refits = {t.joint: t for t in trajectories}, list(cross_fits)
    for motion in motions:
        if not motion.at_rest:
            others = [fit for fit in refits if fit.group == motion.joint]
            yield from left_out(motion, periods.get(motion.joint), others, robot.joint(motion.joint), lowpass)


def fit_joint(
    model: IndependentJoint, parts: Sequence[Part], robot: Robot, others: Sequence[str], omitted: float, lowpass: float
) -> Iterator[
    Fit | CrossFit | FittedPaths | Guess | Identifiability | MeasurementNoise | Residual | SwarmSearch | Diagnostic
]:
    """Fit one joint by every estimator, with residuals, identifiability and noise; `others` move in its logs, too.

    `omitted` is the largest harmonic that its motion lacks, over the largest of all.
    """
    regression = join_regressions([part.regression for part in parts])
    regression = replace(regression, model_std=model_errors(model, parts, robot, regression))
    estimates: dict[str, Estimate] = {}
    for name in ESTIMATORS:
        try:
            estimate = estimator(name)(regression)
        except NotIdentifiable as error:
            yield diagnostic("fit", model.group, "note", f"{model.group}: {name} is left out: {error}")
            continue
        estimates[name] = estimate
        yield fit_record(parts, model, name, regression, estimate, lowpass)
        for part in parts:  # (6.54)
            tau_hat, tau = part.regression.Phi @ estimate.theta, part.regression.tau
            yield Residual(part.log, model.group, model.name, name, part.rate, part.t, part.dq, tau, tau_hat)
        yield from (swarm_search(model, name, search, regression) for search in estimate.run_searches())
    yield from assess_identifiability(model, regression, estimates, robot, others, omitted)
    yield from cost_of_consistency(model.group, regression, estimates, robot.joint(model.group).unit("{effort}"))
    if len(parts) > 1:
        for name in ESTIMATORS:
            yield from cross_fits([part.log for part in parts], model, name, regression)
    yield from guesses(model, regression)
    yield from fitted_paths(model.group, parts)
    yield MeasurementNoise(model.group, *np.sqrt(np.mean([np.square(part.noise) for part in parts], axis=0)).tolist())


def model_errors(model: IndependentJoint, parts: Sequence[Part], robot: Robot, regression: Regression) -> Array | float:
    """Return the standard errors of the parameters due to the model (p,); 0 if least squares are not possible."""
    ranges, dq = [float(np.ptp(part.q)) for part in parts], np.concatenate([part.dq for part in parts])
    reach = Reach(round_scale(max(ranges)), round_scale(float(np.sqrt(np.mean(dq**2)))))
    every = with_every_term(robot.joint(model.group), reach)
    cells = side_by_side([block_equations(every, part.source) for part in parts], range(len(parts)), len(parts))
    library = Library(every, (), CellEquations(np.zeros(1, int), np.zeros(1), cells, cells, cells))
    candidates = variants(robot, "independent", {model.group: reach}, [library])
    try:
        theta = regression.triangle.theta
        noise_std = standard_errors(regression, theta).noise
        return model_std(candidates[0].parts[0], theta, noise_std, candidates, len(parts))
    except (NotIdentifiable, np.linalg.LinAlgError):
        return 0.0


def assess_identifiability(
    model: IndependentJoint,
    regression: Regression,
    estimates: dict[str, Estimate],
    robot: Robot,
    others: Sequence[str],
    omitted: float,
) -> Iterator[Identifiability | Diagnostic]:
    """Assess how well the logs determine the parameters, and explain an inertia that is not positive."""
    plain = estimates.get("lse")
    if plain is None:
        return
    joint, excitation = robot.joint(model.group), analyse_columns(regression.triangle)
    names = parameter_columns(model)["parameter"]
    pairs = identifiability.describe_correlated(names.tolist(), excitation)
    insignificant = identifiability.describe_insignificant(regression, plain)
    yield Identifiability(
        group=model.group,
        model=model.name,
        scaled_condition=excitation.condition,
        together=tuple(pairs),
        not_seen=tuple(insignificant),
        advice=identifiability.advice(robot, joint, (*pairs, *insignificant)),
        parameter=np.repeat(names, len(names)),
        beside=np.tile(names, len(names)),
        correlation=excitation.correlation.ravel(),
    )
    wrong = [name for name, estimate in estimates.items() if inertia_of(model.terms, estimate.theta) <= 0.0]
    if wrong:
        estimate = plain if "lse" in wrong else estimates[wrong[0]]
        verb = "estimates" if len(wrong) == 1 else "estimate"
        why = identifiability.why_not_positive(robot, joint, estimate, excitation, others)
        message = f"{model.group}: {join_names(wrong)} {verb} an inertia that is not positive: {why}"
        yield diagnostic("fit", model.group, "note", message)  # `predict` warns if this model is used
    if message := identifiability.hardly_described(joint, r_squared(regression, plain), others, omitted):
        severity = "note" if others else "warning"  # with others, a model of the whole arm may be used
        yield diagnostic("fit", model.group, severity, f"{model.group}: {message}")


def cost_of_consistency(
    group: str, regression: Regression, estimates: dict[str, Estimate], unit: str
) -> Iterator[Diagnostic]:
    """State how much worse physically consistent parameters fit, where those of least squares are not consistent."""
    if "lse" not in estimates or "consistent" not in estimates:
        return
    signs = regression.known.signs(len(regression.names))
    wrong = [name for name, x, is_signed in zip(regression.names, estimates["lse"].theta, signs, strict=True)
             if is_signed and x < 0]  # fmt: skip
    if wrong:
        pair = (fit_residual(regression, estimates[name].theta) for name in ("consistent", "lse"))
        rmse, before = (np.sqrt(np.mean(residual**2)) for residual in pair)
        message = f"{group}: lse estimates a negative {join_names(wrong)}, which no mechanism has"
        cost = f"{rmse:.3g} {unit} root mean square instead of {before:.3g} {unit}"
        yield diagnostic("fit", group, "note", f"{message}; consistent has none, and leaves an effort of {cost}")


def fit_residual(regression: Regression, theta: Array) -> Array:
    """Residual effort of parameters (p,) on the data of a fit, without standstill."""
    return np.asarray((regression.tau - regression.Phi @ theta)[regression.periods > 0])


def r_squared(regression: Regression, estimate: Estimate) -> float:
    """Share of the effort's variance that a fit explains, R2."""
    tau, residual = regression.tau[regression.periods > 0], fit_residual(regression, estimate.theta)
    spread = tau - tau.mean()
    return float(1 - residual @ residual / (spread @ spread))


def periodic_part(model: IndependentJoint, t: Trajectory, prior: Prior = NO_PRIOR) -> Part:
    """Regression over an averaged period; `prior` holds parameters from tables."""
    sigmas = (t.sigma_q, t.sigma_dq, t.sigma_tau)
    return Part(t.log, t.rate, t.periods, t.period, sigmas, t.t, t.q, t.dq, pose(model, t, prior), t)


def sampled_part(model: IndependentJoint, record: Motion, lowpass: float, prior: Prior) -> Part:
    """Regression over samples of a motion that does not repeat, with motion and effort through one low-pass."""
    log = observe([record], (), lowpass, 0)
    regression, rows = pose_samples(model, log, known=prior)
    step = float(np.median(np.diff(rows))) if len(rows) > 1 else 1.0
    t, q, dq = (x[rows] for x in (record.t, record.q, record.dq))
    sigmas = (record.sigma_q, record.sigma_dq, record.sigma_tau)
    return Part(record.log, record.rate / step, 1, float(t[-1] - t[0]), sigmas, t, q, dq, regression, log)


def fit_record(
    parts: Sequence[Part],
    model: IndependentJoint,
    name: str,
    regression: Regression,
    estimate: Estimate,
    lowpass: float,
) -> Fit:
    """The Fit of an estimate, with its mean square error and R2 on its own data."""
    squares, r2 = fit_residual(regression, estimate.theta) ** 2, r_squared(regression, estimate)
    mse, mse_std = float(np.mean(squares)), error_of_pooled_mean(squares)
    return Fit.like(
        estimate,
        group=model.group,
        model=model.name,
        estimator=name,
        structure="independent",
        cutoff=(lowpass,),
        effort_lag=(0.0,),
        logs=tuple(part.log for part in parts),
        samples=len(regression.tau),
        periods=min(part.periods for part in parts),
        mse=mse,
        mse_std=mse_std,
        r2=r2,
        r2_std=(1.0 - r2) * mse_std / (mse or 1.0),
        condition=float(np.linalg.cond(regression.Phi)),
        correlated_lags=round(estimate.standard_errors.lags),
        **{f"theta_std_{of}": getattr(estimate.standard_errors, of) for of in ("noise", "model", "classical")},
        **parameter_columns(model),
    )


def guesses(model: IndependentJoint, regression: Regression) -> Iterator[Guess]:
    """The parameters from the robot's tables, where it has any.  (6.7), (6.10), (6.13)"""
    theta = regression.known.guess
    if theta is None:
        return
    squares = fit_residual(regression, theta) ** 2
    mse, mse_std = float(np.mean(squares)), error_of_pooled_mean(squares)
    columns = parameter_columns(model)
    yield Guess(model.group, mse, mse_std, columns["parameter"], columns["unit"], theta)


def swarm_search(model: IndependentJoint, name: str, search: Search, regression: Regression) -> SwarmSearch:
    """The record of a swarm search, with its history.  Fig 6.14"""
    return SwarmSearch.like(
        search,
        group=model.group,
        model=model.name,
        estimator=name,
        iterations=len(search.history),
        mse=float(search.history[-1]),
        mse_std=error_of_pooled_mean(fit_residual(regression, search.theta) ** 2),
        best_mse=search.history,
    )


def cross_fits(
    logs: Sequence[str], model: IndependentJoint, name: str, regression: Regression
) -> Iterator[CrossFit | Diagnostic]:
    """Estimate the parameters without each fold of the logs; a diagnostic names folds that no refit can omit."""
    fold = folds(len(logs))
    left_out, thetas = [], []
    for out, theta in enumerate(refits(regression, estimator(name))):
        names = ", ".join(log for log, number in zip(logs, fold, strict=True) if number == out)
        if isinstance(theta, NotIdentifiable):
            text = f"{name} has no leave-out score of {names}, because a refit is not possible: {theta}"
            yield diagnostic("fit", model.group, "note", f"{model.group}: {text}")
        else:
            left_out.append(names)
            thetas.append(theta)
    columns = parameter_columns(model)
    yield CrossFit(
        group=model.group,
        model=model.name,
        estimator=name,
        left_out=np.repeat(np.array(left_out, object), len(model.parameters)),
        parameter=np.tile(columns["parameter"], len(thetas)),
        unit=np.tile(columns["unit"], len(thetas)),
        theta=np.concatenate([[], *thetas]),
    )


def fitted_paths(joint: str, parts: Sequence[Part]) -> Iterator[FittedPaths | Diagnostic]:
    """The paths of a joint's logs; of more than `MAX_PATHS` paths, those that differ most."""
    speed = max(speed_of(part.dq) for part in parts)
    indices, likeness = most_different([(part.t, part.q, part.period) for part in parts], MAX_PATHS)
    if likeness < SAME_PATH:
        message = f"{joint}: its identification logs follow more than {MAX_PATHS} paths"
        follows = f"recordings are compared with the {MAX_PATHS} that differ most, so a path may be called new"
        yield diagnostic("fit", joint, "note", f"{message}; {follows} that is not")
    parts = [parts[i] for i in indices]
    yield FittedPaths(
        joint=joint,
        speed=speed,
        source=np.repeat(np.array([part.log for part in parts], object), [len(part.t) for part in parts]),
        period=np.repeat([part.period for part in parts], [len(part.t) for part in parts]),
        t=np.concatenate([part.t for part in parts]),
        q=np.concatenate([part.q for part in parts]),
    )
