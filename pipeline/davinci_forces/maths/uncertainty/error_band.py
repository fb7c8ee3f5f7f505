"""The deviation of a smoothed external effort, calibrated on free motion outside the fits, by range of speed.

The smoother's own variance S^2 knows nothing of the model's error, whose variance is v = mean(e^2 - S^2), at least 0:

    sigma = k (S^2 + v)^(1/2),    k = q / 1.96,    q the 95 % quantile of |e| / (S^2 + v)^(1/2)

So 1.96 sigma has the stated coverage, whatever the distribution of the errors e.  All logs have equal weight.

The quantile of a range of speed shrinks towards that of all speeds, in logarithms, where it has few errors.  Errors are
correlated, so n uncorrelated ones are counted.  As in conformal prediction, the quantile is that of (n + 1) / n times
95 %.  The model's error differs from log to log, and a few logs hardly show by how much.  So v is multiplied by the
square of Student's 95 % point over 1.96.  Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World (2005).

`levels` checks the coverage of the resulting band on samples without contact.  `day_offset` is a constant effort that
differs from day to day: the mean without contact, and its drift.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array, Booleans, Integers, evenly, row_blocks
from davinci_forces.maths.signals.windows import is_outside
from davinci_forces.maths.uncertainty.bootstrap import blocks, error_of_mean, error_of_pooled_mean, error_of_quantile

SPEED_RANGES = 4  # ranges of speed, between quartiles of the calibrating motion
LOG_BLOCKS = 6  # blocks of a log: each counts as a degree of freedom of the model's error
MIN_LOGS_BAND = 3  # with fewer logs, standard errors compare blocks instead
SHRINKAGE = 10.0  # uncorrelated errors at which the quantile of a range counts as much as that of all speeds
DETECTED_SHARE = 0.99  # share of free-space samples below the detection level
TYPICAL_SHARE = 0.95  # share of free-space samples below the lower level
TINY = 1e-12  # size of an error of 0, so that it has a logarithm
NORMAL_95 = 1.959963984540054
MIN_SAMPLES_QUARTILES = 100
MAX_SAMPLES_BOOTSTRAP = 20_000  # of more samples, evenly spaced ones are drawn
MIN_DRIFT_ERRORS = 2.0  # a day offset that differs by more standard errors between the halves of a log drifts


class FreeErrors(NamedTuple):
    """Errors of a smoothed external effort in free motion outside the fits, (C,) each."""

    source: Integers  # number of the log
    block: Integers
    dq: Array
    error: Array
    std: Array  # the smoother's own
    uncorrelated: Array  # number of uncorrelated errors that each stands for

    def select(self, which: Booleans) -> "FreeErrors":
        """Select errors."""
        return FreeErrors(*(column[which] for column in self))  # type: ignore[arg-type]

    @property
    def weight(self) -> Array:
        """Weight (C,) of each error: all logs together have 1, each log the same."""
        _, log, count = np.unique(self.source, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / (count[log] * len(count)))

    @property
    def unit(self) -> Integers:
        """Uncorrelated unit of each error (C,): its log, or its block if logs are few."""
        return self.source if len(np.unique(self.source)) >= MIN_LOGS_BAND else self.source * LOG_BLOCKS + self.block


class Calibration(NamedTuple):
    """The deviation of a smoothed external effort in units of its own, by range of speed."""

    edges: Array  # (SPEED_RANGES - 1,) speeds between the ranges
    factor: Array  # (SPEED_RANGES,) k
    model_variance: float  # v, as wide as the number of logs asks for
    relative_std: float  # standard error of k, relative

    def variance(self, std: Array, dq: Array) -> Array:
        """Total variance (N,) from the smoother's own deviation (N,), along its velocity (N,)."""
        variance = np.empty(len(dq))
        for rows in row_blocks(len(dq)):
            factor = self.factor[speed_range(dq[rows], self.edges)]
            variance[rows] = factor**2 * (std[rows] ** 2 + self.model_variance)
        return variance


def speed_range(dq: Array, edges: Array) -> Integers:
    """Number of the range of speed of each sample (N,)."""
    return np.searchsorted(edges, np.abs(dq))


def calibrate(data: FreeErrors) -> Calibration:
    """Calibrate the deviation of an external effort on its errors in free motion (C,)."""
    weight, n = data.weight, float(data.uncorrelated.sum())
    v = max(float(np.sum(weight * (data.error**2 - data.std**2))), 0.0)
    size, share = np.abs(data.error) / np.sqrt(data.std**2 + v) + TINY, min((1.0 + 1.0 / n) * TYPICAL_SHARE, 1.0)
    edges = np.quantile(np.abs(data.dq), np.arange(1, SPEED_RANGES) / SPEED_RANGES)
    inside = [speed_range(data.dq, edges) == number for number in range(SPEED_RANGES)]

    def log_quantile(which: Booleans) -> float:
        return float(np.log(np.quantile(size[which], share, weights=weight[which], method="inverted_cdf")))

    overall = log_quantile(np.ones(len(size), np.bool_))
    by_range = np.array([log_quantile(which) if which.any() else overall for which in inside])
    trust = np.array([data.uncorrelated[r].sum() for r in inside])
    trust /= trust + SHRINKAGE
    factor = np.exp(trust * by_range + (1.0 - trust) * overall) / NORMAL_95
    widening = students_95(LOG_BLOCKS * len(np.unique(data.source))) / NORMAL_95
    # The standard error of the logarithm of the quantile, from its spread over units; NaN for one unit.
    logs = [np.log(np.quantile(size[data.unit == number], TYPICAL_SHARE)) for number in np.unique(data.unit)]
    spread = float(np.std(logs, ddof=1) / len(logs) ** 0.5) if len(logs) > 1 else float("nan")
    return Calibration(edges, factor, widening**2 * v, spread)


def students_95(degrees: int) -> float:
    """The value that Student's t exceeds, on either side, with a probability of 5 %."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.5 + 0.5 * TYPICAL_SHARE))


def count_uncorrelated(x: Array) -> float:
    """Number of uncorrelated samples in a series (N,): N over the sum of its autocorrelation up to its first zero."""
    centred, N, lags, covariance = x - x.mean(), len(x), BLOCK_SAMPLES // 64, np.ones(1)
    while covariance.min() >= 0.0 and len(covariance) < N:  # block by block, because a series may be long
        lags, covariance = min(2 * lags, N), np.zeros(min(2 * lags, N))
        for start in range(0, N, lags):
            block, reached = (np.fft.rfft(centred[start : start + n], 4 * lags) for n in (lags, 2 * lags))
            covariance += np.fft.irfft(block.conj() * reached)[:lags]
    if covariance[0] <= 0.0:
        return 1.0
    until = int(np.argmax(covariance < 0.0)) or N
    return float(max(N / (1.0 + 2.0 * np.sum(covariance[1:until]) / covariance[0]), 1.0))


def coverage_by_speed(tau_ext: Array, std: Array, dq: Array) -> tuple[Array, Array]:
    """Coverage (4,) of a 95 % band in each quartile of speed, with standard errors, by block bootstrap.

    `tau_ext` (N,) is in free space, with its standard deviation (N,) and velocity (N,).  Empty arrays where N < 100.
    """
    if len(dq) < MIN_SAMPLES_QUARTILES:
        return np.zeros(0), np.zeros(0)
    n, inside = count_uncorrelated(tau_ext / std) / 4, np.abs(tau_ext) <= NORMAL_95 * std
    quartiles = np.array_split(np.argsort(np.abs(dq), kind="stable"), 4)
    parts = [inside[np.sort(quartile)].astype(float) for quartile in quartiles]
    return np.array([part.mean() for part in parts]), np.array([error_of_coverage(part, n) for part in parts])


def error_of_coverage(inside: Array, n: float) -> float:
    """Standard error of the share of samples (N,) inside a band, which stand for n uncorrelated ones.

    By block bootstrap, but at least that of n draws with two more inside and two more outside.  For blocks without a
    sample outside do not show that none will be.  Agresti and Coull, The American Statistician 52 (1998).
    """
    share = (n * float(inside.mean()) + 2.0) / (n + 4.0)
    return float(np.fmax(error_of_pooled_mean(inside), np.sqrt(share * (1.0 - share) / (n + 4.0))))


class FreeSpaceLevels(NamedTuple):
    """Levels of |tau_ext| in free space, with standard errors by block bootstrap."""

    free_rms: float
    free_rms_std: float
    free_level: float
    free_level_std: float
    detection_level: float
    detection_level_std: float
    coverage: float  # share of samples within 1.96 stated standard deviations
    coverage_std: float


def levels(tau_ext: Array, std: Array) -> FreeSpaceLevels:
    """Levels of an external effort (N,) with stated standard deviation `std` (N,), in free space."""
    samples = evenly(len(tau_ext), MAX_SAMPLES_BOOTSTRAP)
    size, inside = np.abs(tau_ext[samples]), (np.abs(tau_ext[samples]) <= NORMAL_95 * std[samples]).astype(float)
    return FreeSpaceLevels(
        free_rms=float(np.sqrt(np.mean(size**2))),
        free_rms_std=error_of_pooled_mean(size**2, function=np.sqrt),
        free_level=float(np.quantile(size, TYPICAL_SHARE)),
        free_level_std=error_of_quantile(size, TYPICAL_SHARE),
        detection_level=float(np.quantile(size, DETECTED_SHARE)),
        detection_level_std=error_of_quantile(size, DETECTED_SHARE),
        coverage=float(np.mean(inside)),
        coverage_std=error_of_coverage(inside, count_uncorrelated(tau_ext[samples] / std[samples])),
    )


class DayOffset(NamedTuple):
    """An offset with its standard error, and its drift from the first to the second half of the samples."""

    value: float
    std: float
    drift: float
    drift_std: float

    @property
    def drifts(self) -> bool:
        """Whether the halves differ by more than `MIN_DRIFT_ERRORS` standard errors."""
        return abs(self.drift) > MIN_DRIFT_ERRORS * self.drift_std


def day_offset(t: Array, residual: Array, windows: Sequence[tuple[float, float]]) -> DayOffset:
    """Average the residual effort (N,) of a model in free windows [s]; 0 for fewer than two samples in them."""
    inside = residual[~is_outside(t, windows)]
    if len(inside) < 2:
        return DayOffset(0.0, 0.0, 0.0, 0.0)
    (first, first_std), (last, last_std), (value, std) = map(_mean, (*np.array_split(inside, 2), inside))
    return DayOffset(value, std, last - first, float(np.hypot(first_std, last_std)))


def _mean(x: Array) -> tuple[float, float]:
    """The mean of correlated samples and its standard error."""
    parts = [float(x[part].mean()) for part in blocks(len(x))]
    return float(x.mean()), error_of_mean(parts) if len(parts) > 1 else float(abs(x[0]))
