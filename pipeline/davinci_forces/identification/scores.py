"""Scores of predicted efforts: raw, and with effort and prediction through the same low-pass."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimator, Regression
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.smoothing import lowpass_segments, share_passed, white_std
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, model_error, root_mean_square
from davinci_forces.records import Motion, Prediction

MAX_FOLDS = 20  # this number of refits is enough for out-of-sample errors, whatever the amount of data
SAMPLES_RIVAL = 1111  # number of samples of the errors published for the compared method


def folds(count: int) -> list[int]:
    """Return the fold of each of `count` logs or periods, in order; above `MAX_FOLDS`, neighbours share a fold."""
    number = min(count, MAX_FOLDS)
    return [i * number // count for i in range(count)]


def refits(problem: Regression, estimate: Estimator) -> Iterator[Array | NotIdentifiable]:
    """Fit the parameters (p,) without each fold of the logs in turn, or yield why a fit is not possible."""
    fold = folds(len(problem.starts))
    for out in range(fold[-1] + 1):
        try:
            yield estimate(select_logs(problem, [log for log, number in enumerate(fold) if number != out])).theta
        except NotIdentifiable as error:
            yield error


def select_logs(problem: Regression, logs: Sequence[int]) -> Regression:
    """Return the least squares problem of some of its logs, by their index."""
    ends = (*problem.starts[1:], len(problem.tau))
    parts = [np.arange(problem.starts[i], ends[i]) for i in logs]
    rows = np.concatenate(parts)
    return replace(
        problem,
        Phi=problem.Phi[rows],
        tau=problem.tau[rows],
        tau_var=problem.tau_var[rows],
        periods=problem.periods[rows],
        starts=tuple(np.cumsum([0, *map(len, parts[:-1])]).tolist()),
        noise=None if problem.noise is None else problem.noise[rows],
        Phi_cov=None if problem.Phi_cov is None else problem.Phi_cov[list(logs)],
    )


class Scorer:
    """The effort of a recording, against which predictions are scored; shared results are computed once.

    `free` (N,) are the scored samples, at which nothing touches the robot.  `white` is the noise of the effort from
    repeated periods.  Without it, the noise is the part of the error that a low-pass removes, including drive ripple.
    """

    def __init__(self, motion: Motion, free: Booleans, lowpass: float, white: float | None = None) -> None:
        self.motion, self.lowpass, self.white = motion, lowpass, white
        self.free = slice(None) if free.all() else free
        tau = motion.tau[self.free]
        self.smooth = self._smoothed(motion.tau)[self.free]
        self.effort = root_mean_square(self.smooth)
        self.range, self.variance = float(np.ptp(tau)) or 1.0, float(tau.var()) or 1.0
        self.spread = float(np.linalg.norm(tau - tau.mean())) or 1.0
        self.passed = share_passed(motion.rate, lowpass)

    def score(self, model: str, name: str, role: str, scheme: str, path: str, tau_hat: Array) -> Prediction:
        """Return a prediction (N,) with its scores."""
        error = self.motion.tau - tau_hat
        slow = self._smoothed(error)
        noise = white_std(error - slow, self.passed) if self.white is None else self.white
        error, slow = error[self.free], slow[self.free]
        unexplained = float(np.linalg.norm(error)) / self.spread
        rmse, rmse_std = root_mean_square(error)
        unexplained_std = unexplained * rmse_std / (rmse or 1.0)
        relative, relative_std = root_mean_square(slow, self.smooth)
        rival, rival_std = root_mean_square(slow[:SAMPLES_RIVAL], self.smooth[:SAMPLES_RIVAL])
        effort_rms, effort_rms_std = self.effort
        ceiling = noise**2 / self.variance
        beyond_noise, beyond_noise_std = model_error(slow, noise * np.sqrt(self.passed))
        return Prediction(
            log=self.motion.log,
            joint=self.motion.joint,
            model=model,
            estimator=name,
            role=role,
            scheme=scheme,
            path=path,
            rmse=rmse,
            rmse_std=rmse_std,
            nrmse=rmse / self.range,
            nrmse_std=rmse_std / self.range,
            r2=1.0 - unexplained**2,
            r2_std=2.0 * unexplained * unexplained_std,  # for this effort, whose variance is known
            fit_percent=100.0 * (1.0 - unexplained),
            fit_percent_std=100.0 * unexplained_std,
            r2_ceiling=1.0 - ceiling,
            r2_ceiling_std=ceiling * float(np.sqrt(2.0 / len(error))),  # the noise is white
            model_error=beyond_noise,
            model_error_std=beyond_noise_std,
            mean_error=float(np.mean(slow)),
            mean_error_std=error_of_pooled_mean(slow),
            effort_rms=effort_rms,
            effort_rms_std=effort_rms_std,
            relative_error=relative,
            relative_error_std=relative_std,
            relative_error_1111=rival,
            relative_error_1111_std=rival_std,
            t=self.motion.t,
            tau=self.motion.tau,
            tau_hat=tau_hat,
        )

    def _smoothed(self, x: Array) -> Array:
        return lowpass_segments(x, self.motion.segment, self.motion.rate, self.lowpass)


def select_samples(motion: Motion, which: Booleans | slice) -> Motion:
    """Return some of the samples (N,) of a recording."""
    return replace(motion, **{name: getattr(motion, name)[which] for name in motion.columns()})
