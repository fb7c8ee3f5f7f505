"""Scores of predicted efforts: raw, and with effort and prediction through the same low-pass."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import Estimator, Regression
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.smoothing import lowpass_segments, share_passed, white_std
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, model_error
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
        rmse = float(np.sqrt(error @ error / len(error)))
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
            nrmse=rmse / self.range,
            r2=1.0 - unexplained**2,
            fit_percent=100.0 * (1.0 - unexplained),
            r2_ceiling=1.0 - noise**2 / self.variance,
            model_error=beyond_noise,
            model_error_std=beyond_noise_std,
            mean_error=float(np.mean(slow)),
            mean_error_std=error_of_pooled_mean(slow),
            effort_rms=float(np.sqrt(np.mean(self.smooth**2))),
            relative_error=relative(slow, self.smooth),
            relative_error_1111=relative(slow[:SAMPLES_RIVAL], self.smooth[:SAMPLES_RIVAL]),
            t=self.motion.t,
            tau=self.motion.tau,
            tau_hat=tau_hat,
        )

    def _smoothed(self, x: Array) -> Array:
        return lowpass_segments(x, self.motion.segment, self.motion.rate, self.lowpass)


def select_samples(motion: Motion, which: Booleans | slice) -> Motion:
    """Return some of the samples (N,) of a recording."""
    return replace(motion, **{name: getattr(motion, name)[which] for name in motion.columns()})


def relative(error: Array, tau: Array) -> float:
    """Return the norm of an error (N,) over that of the effort (N,)."""
    return float(np.linalg.norm(error) / (np.linalg.norm(tau) or 1.0))
