"""Out-of-sample predictions of identification logs, by the joints' own fits and, for comparison, by candidates."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import Estimator, Prior
from davinci_forces.identification.candidates import Candidate, CandidatePart
from davinci_forces.identification.observations import Observed, averaged_samples, is_evaluated, observe, pose_samples
from davinci_forces.identification.regression import known_of, pose, recorded_motion, stands_still
from davinci_forces.identification.scores import Scorer, folds
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.selection import MAX_GROUPS, PATH_BLOCKS, Equations, excited_parameters, solve, sum_all
from davinci_forces.records import CrossFit, Diagnostic, Motion, Prediction, Trajectory, diagnostic
from davinci_forces.records.prediction import ANOTHER_PATH, CHOSEN, CHOSEN_BY_LOG, SAME_PATH
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint


def left_out(
    motion: Motion, average: Trajectory | None, refits: Sequence[CrossFit], joint: Joint, lowpass: float
) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of an identification log by refits without that log, or without parts of a single log."""
    model, prior = independent(joint), known_of(joint)
    part = motion if average is None else motion.select(whole_periods(motion.t, average))
    scorer = Scorer(part, is_evaluated(part), lowpass, None if average is None else average.sigma_tau_white)
    if refits:
        yield from without_the_log(part, scorer, refits, model)
        return
    if average is None:
        scheme, path, predict = "leave a segment out", ANOTHER_PATH, without_a_segment(motion, model, prior, lowpass)
    else:
        scheme, path, predict = "leave one period out", SAME_PATH, without_a_period(part, average, model, prior)
    for name in ESTIMATORS:
        try:
            yield scorer.score(model.name, name, scheme, path, predict(estimator(name)))
        except NotIdentifiable as error:
            text = f"{name} has no leave-out score, because a refit is not possible: {error}"
            yield diagnostic("fit", f"{motion.log}.{motion.joint}", "note", f"{motion.log}/{motion.joint}: {text}")


def without_the_log(
    part: Motion, scorer: Scorer, cross_fits: Iterable[CrossFit], model: IndependentJoint
) -> Iterator[Prediction]:
    """Predict the periods of a log, or all of it, from fits to other identification logs."""
    along = recorded_motion(part)
    for fit in cross_fits:
        left_out = [str(names).split(", ") for names in fit.left_out]
        rows = [row for row, names in enumerate(left_out) if part.log in names]
        if rows:
            number = len(left_out[rows[0]])
            scheme = "leave one log out" if number == 1 else f"leave {number} logs out"
            tau_hat = np.ascontiguousarray(efforts(model, fit.theta[rows], along)[:, 0])
            yield scorer.score(fit.model, fit.estimator, scheme, ANOTHER_PATH, tau_hat)


def without_a_period(
    part: Motion, average: Trajectory, model: IndependentJoint, prior: Prior
) -> Callable[[Estimator], Array]:
    """Return how an estimator predicts each period of a log from fits to the others, which repeat the period's path."""
    period = np.minimum(((part.t - average.t_start) / average.period + 1e-9).astype(int), average.periods - 1)
    fold, measured = np.array(folds(average.periods))[period], part.filled == 0
    problem, moving = pose(model, average, prior), ~stands_still(average)
    samples = part.t[measured], part.tau[measured], average.period, len(average.t), fold[measured]
    others = [
        replace(problem, tau=effort.mean, tau_var=effort.var, periods=np.where(moving, effort.counts, 0))
        for effort in averaging.left_out(*samples)
    ]
    Phi = np.split(model.regressor(recorded_motion(part)).Phi[:, 0], np.searchsorted(fold, np.arange(1, len(others))))

    def predict(estimate: Estimator) -> Array:
        return np.concatenate([rows @ estimate(rest).theta for rows, rest in zip(Phi, others, strict=True)])

    return predict


def without_a_segment(
    motion: Motion, model: IndependentJoint, prior: Prior, lowpass: float
) -> Callable[[Estimator], Array]:
    """Return how an estimator predicts each sixth of a log that does not repeat from fits to the other five."""
    log = observe([motion], (), lowpass, 0)
    Phi = model.regressor(recorded_motion(motion)).Phi[:, 0]

    def predict(estimate: Estimator) -> Array:
        tau_hat = np.empty(len(motion))
        for out in (log.block == block for block in range(PATH_BLOCKS)):
            tau_hat[out] = Phi[out] @ estimate(pose_samples(model, log, ~out, prior)[0]).theta
        return tau_hat

    return predict


def whole_periods(t: Array, average: Trajectory) -> slice:
    """Return the samples of the averaged periods, at these times [s], as a slice, because its views take no memory."""
    inside = np.flatnonzero(averaged_samples(t, average))
    return slice(int(inside[0]), int(inside[-1]) + 1)


class Scheme(NamedTuple):
    """The cells of the equations that refits leave out, and the refit that predicts each sample of a log."""

    name: str
    path: str  # whether the path left out is repeated in the fitted data
    cells: Equations
    out: Booleans  # (G, C) the cells that each refit leaves out
    refit: Integers  # (N,) number of the refit that predicts each sample, from 0; -1 for none


class RefitModel:
    """One part of a candidate, refitted without some of its cells; each refit is computed once."""

    def __init__(self, part: CandidatePart, total: int) -> None:
        self.model, self.logs, self.total = part.model, {log.number: log for log in part.library.logs}, total
        self.by_block, self.by_period = part.by_block, part.by_period
        self._ridge, self._thetas = part.ridge, dict[bytes, Array]()

    def excites_all(self, cells: Equations, out: Booleans) -> bool:
        """Whether the cells of a refit excite every base parameter that all cells excite."""
        reduced, full = cells.sum_groups([~out]), sum_all(cells)
        return excited_parameters(reduced, self._ridge) == excited_parameters(full, self._ridge)

    def theta(self, cells: Equations, out: Booleans) -> Array:
        """Fit the parameters (p,) without some cells (C,); raises LinAlgError if the others do not separate them."""
        key = out.tobytes()
        if key not in self._thetas:
            self._thetas[key] = solve(cells.sum_groups([~out]), self._ridge)
        return self._thetas[key]


def predictions(
    candidate: Candidate, logs: Sequence[Observed], used: Mapping[str, str] | None = None
) -> Iterator[Prediction | Diagnostic]:
    """Predict the effort of each joint of all logs by refits of a candidate, by the scheme of the joints' own fits.

    The chosen candidate has the estimator of the fit that is `used` of each group.  It is refitted, always by its own
    estimator, without blocks of path, as `chosen`, and without whole logs if it has several, as `chosen_by_log`.
    Without a refit there is no prediction.
    """
    name = f"{candidate.variant}.{candidate.estimator}"
    models = [RefitModel(part, len(logs)) for part in candidate.parts]
    for number in (log.number for log in logs):
        for model in (model for model in models if number in model.logs):
            log = model.logs[number]
            if used:
                chosen = f"{candidate.variant}.{used[model.model.group]}"
                scheme = leave_blocks_out(model, log, "leave a block of path out")
                yield from predict_scheme(scheme, model, log, CHOSEN, chosen)
                if len(model.logs) > 1:
                    yield from predict_scheme(scheme_of_own_fits(model, log), model, log, CHOSEN_BY_LOG, chosen)
            elif name != "independent.lse":  # this candidate is the joint's own fit
                scheme = scheme_of_own_fits(model, log)
                yield from predict_scheme(scheme, model, log, candidate.variant, candidate.estimator)


def predict_scheme(
    scheme: Scheme, refits: RefitModel, log: Observed, name: str, estimator: str
) -> Iterator[Prediction | Diagnostic]:
    """Predict the efforts of a model in a log, each sample out of sample, and score the moving samples."""
    if not all(refits.excites_all(scheme.cells, out) for out in scheme.out):
        text = f"{log.records[0].log}: {name}, {estimator} has no leave-out score of {', '.join(refits.model.efforts)}"
        why = "the data that are not left out excite fewer of its parameters"
        yield diagnostic("choose", "arm", "note", f"{text}, because {why}")
        return
    try:
        thetas = np.array([refits.theta(scheme.cells, out) for out in scheme.out])
    except np.linalg.LinAlgError:
        return
    is_predicted = scheme.refit >= 0
    predicted = {
        p: efforts(refits.model, thetas, log.motion(i), scheme.refit)[is_predicted]
        for p, i in {p: i for i, p in enumerate(log.processing) if log.joints[i] in refits.model.efforts}.items()
    }
    for m, effort in enumerate(refits.model.efforts):
        i = log.joints.index(effort)
        record = log.records[i].select(is_predicted)
        moves = is_evaluated(record)
        if not record.at_rest and moves.any():
            tau_hat = predicted[log.processing[i]][:, m]
            scorer = Scorer(record, moves, log.lowpass, log.white.get(effort))
            yield scorer.score(name, estimator, scheme.name, scheme.path, tau_hat)


def leave_blocks_out(refits: RefitModel, log: Observed, name: str) -> Scheme:
    """Leave each sixth of the path out, of all logs together."""
    out = np.tile(np.arange(PATH_BLOCKS), refits.total) == np.arange(PATH_BLOCKS)[:, None]
    return Scheme(name, ANOTHER_PATH, refits.by_block, out, log.block)


def scheme_of_own_fits(refits: RefitModel, log: Observed) -> Scheme:
    """Leave out what the joints' own fits leave out: the fold of the log or, of a single log, a period or a segment."""
    if len(refits.logs) > 1:
        fold = dict(zip(refits.logs, folds(len(refits.logs)), strict=True))
        omitted = [number for number in fold if fold[number] == fold[log.number]]
        out = np.isin(np.repeat(np.arange(refits.total), PATH_BLOCKS), omitted)[None]
        refit = np.where(log.period < 0, -1, 0) if log.period.max() >= 0 else np.zeros_like(log.period)
        name = "leave one log out" if len(omitted) == 1 else f"leave {len(omitted)} logs out"
        return Scheme(name, ANOTHER_PATH, refits.by_block, out, refit)
    if log.period.max() >= 1:
        periods = np.arange(log.period.max() + 1)
        out = MAX_GROUPS * log.number + periods[:, None] == np.arange(MAX_GROUPS * refits.total)
        return Scheme("leave one period out", SAME_PATH, refits.by_period, out, log.period)
    return leave_blocks_out(refits, log, "leave a segment out")
