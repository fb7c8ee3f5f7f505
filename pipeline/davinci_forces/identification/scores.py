"""Scores of predicted efforts: raw, and with effort and prediction through the same low-pass."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import ROWS, Estimator, Regression
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
    columns = {name: x[rows] for name in ROWS if (x := getattr(problem, name)) is not None}
    if problem.Phi_cov is not None:
        columns["Phi_cov"] = problem.Phi_cov[list(logs)]
    return replace(problem, starts=tuple(np.cumsum([0, *map(len, parts[:-1])]).tolist()), **columns)


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

    def score(self, model: str, name: str, scheme: str, path: str, tau_hat: Array) -> Prediction:
        """Return a prediction (N,) with its scores."""
        error = self.motion.tau - tau_hat
        slow = self._smoothed(error)
        noise = white_std(error - slow, self.passed) if self.white is None else self.white
        error, slow = error[self.free], slow[self.free]
        rmse, rmse_std = root_mean_square(error)
        unexplained = float(np.linalg.norm(error)) / self.spread
        unexplained_std = unexplained * rmse_std / (rmse or 1.0)
        ceiling = noise**2 / self.variance
        scores = {
            "rmse": (rmse, rmse_std),
            "nrmse": (rmse / self.range, rmse_std / self.range),
            "r2": (1.0 - unexplained**2, 2.0 * unexplained * unexplained_std),  # for this effort's known variance
            "fit_percent": (100.0 * (1.0 - unexplained), 100.0 * unexplained_std),
            "r2_ceiling": (1.0 - ceiling, ceiling * float(np.sqrt(2.0 / len(error)))),  # the noise is white
            "model_error": model_error(slow, noise * np.sqrt(self.passed)),
            "mean_error": (float(np.mean(slow)), error_of_pooled_mean(slow)),
            "effort_rms": self.effort,
            "relative_error": root_mean_square(slow, self.smooth),
            "relative_error_1111": root_mean_square(slow[:SAMPLES_RIVAL], self.smooth[:SAMPLES_RIVAL]),
        }
        return Prediction(
            log=self.motion.log, joint=self.motion.joint, model=model, estimator=name, role=self.motion.role,
            scheme=scheme, path=path, t=self.motion.t, tau=self.motion.tau, tau_hat=tau_hat,
            **{score: value for score, (value, _) in scores.items()},
            **{f"{score}_std": std for score, (_, std) in scores.items()},
        )  # fmt: skip

    def _smoothed(self, x: Array) -> Array:
        return lowpass_segments(x, self.motion.segment, self.motion.rate, self.lowpass)
