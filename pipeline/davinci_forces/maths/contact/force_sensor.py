"""Errors of an estimated force against a force sensor, and the lag of the sensor.

    e = f_hat - f_s,    relative error = sum_i rms(e_i) / sum_i (max f_s,i - min f_s,i)

over the components i, as Yang et al. (2024, arXiv:2405.07453) define it.  The lag d maximises the correlation of both
forces without their means:

    c(d) = sum f_hat(t) f_s(t + d) / sqrt(sum f_hat(t)^2 sum f_s(t + d)^2)

Standard errors are by block bootstrap.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.mechanics.tip_force import CHI_SQUARED_95
from davinci_forces.maths.uncertainty.bootstrap import blocks, standard_error
from davinci_forces.maths.uncertainty.error_band import NORMAL_95

MAX_LAG_STEPS = 25  # number of lags that are tried on either side of 0
MIN_LAG_STEP = 0.01  # [s] smallest step between lags: a parabola interpolates the correlation of smooth forces
MAX_PEAK_NEIGHBOURS = 10  # the parabola is fitted to at most this number of lags on either side
MIN_CORRELATION = 0.5  # signals with a smaller correlation do not show one force, so there is no lag


class ForceErrors(NamedTuple):
    """Errors of an estimated force, or of one component, in its unit and relative to the range."""

    force_error: float
    force_error_std: float
    force_bias: float  # of a vector, the size of its mean error
    force_bias_std: float
    force_error_max: float
    force_error_max_std: float
    force_range: float  # range of the sensor's force, the mean over components
    force_relative_error: float
    force_relative_error_std: float
    sensor_coverage: float  # share of samples whose 95 % band contains the sensor's force
    sensor_coverage_std: float


def interpolate_sensor(t: Array, clock: Array, f: Array, reach: float) -> Array:
    """Interpolate a sensor (M, k) on its clock (M,) at times (N,); NaN outside, and in gaps over `reach` [s]."""
    following = np.clip(np.searchsorted(clock, t), 1, len(clock) - 1)
    gap = (clock[following] - clock[following - 1] > reach) & (t != clock[following])
    outside = (t < clock[0]) | (t > clock[-1])
    sensor = np.stack([np.interp(t, clock, column) for column in f.T], axis=-1)
    sensor[gap | outside] = np.nan
    return sensor


def errors(estimated: Array, C: Array, measured: Array) -> ForceErrors:
    """Errors of a force (N, k) with covariance (N, k, k), against that of a sensor (N, k)."""
    e, k, span = estimated - measured, measured.shape[1], float(np.ptp(measured, axis=0).mean())
    limit = {1: NORMAL_95**2, 3: CHI_SQUARED_95}[k]
    inside = np.einsum("ni,ni->n", e, np.linalg.solve(C, e[..., None])[..., 0]) <= limit
    parts = blocks(len(e))
    errors_of, covered = [e[part] for part in parts], [inside[part].astype(float)[:, None] for part in parts]
    values = [(f(errors_of), standard_error(f, errors_of)) for f in (_rmse, _bias, _mean_rmse)]
    (rmse, rmse_std), (bias, bias_std), (typical, typical_std) = values
    relative, relative_std = (x / span if span else float("nan") for x in (typical, typical_std))
    if k == 1:
        bias = float(e.mean())
    worst = int(np.linalg.norm(e, axis=1).argmax())
    largest = float(np.linalg.norm(e[worst]))
    largest_std = float(np.sqrt(e[worst] @ C[worst] @ e[worst])) / (largest or 1.0)
    share, share_std = float(np.mean(inside)), standard_error(_bias, covered)
    sizes = rmse, rmse_std, bias, bias_std, largest, largest_std
    return ForceErrors(*sizes, span, relative, relative_std, share, share_std)


def lag(
    t: Array, estimated: Array, clock: Array, measured: Array, rate: float, compared: Booleans
) -> tuple[float, float]:
    """Delay [s] of a sensor (M, k) on its clock (M,) behind the estimated force (N, k) at times (N,), and its error.

    `compared` (N,) selects samples; `rate` [Hz] is that of the estimate.  NaN if the forces do not correlate.
    """
    step = np.ceil(MIN_LAG_STEP * rate - 1e-9) / rate
    lags = step * np.arange(-MAX_LAG_STEPS, MAX_LAG_STEPS + 1)
    f, parts = estimated[compared] - estimated[compared].mean(0), blocks(int(compared.sum()))
    mean, products = measured.mean(0), np.zeros((len(parts), len(lags), 3))
    for j, delay in enumerate(lags.tolist()):
        s = interpolate_sensor(t[compared] + delay, clock, measured, 3.0 / rate) - mean
        comparable = np.isfinite(s).all(1)
        sums = [np.where(comparable, np.einsum("ni,ni->n", a, b), 0.0) for a, b in ((f, s), (f, f), (s, s))]
        products[:, j] = [[float(total[part].sum()) for total in sums] for part in parts]

    def peak(draw: list[Array]) -> float:
        product, f_power, sensor_power = np.sum(draw, axis=0).T
        return _vertex(product / np.sqrt(np.maximum(f_power * sensor_power, 1e-300)), step)

    samples = list(products)
    return peak(samples), standard_error(peak, samples)


def _vertex(c: Array, step: float) -> float:
    """Lag of the largest correlation: the vertex of a parabola fitted to it and its neighbours on both sides.

    Noise decides which of nearly equal correlations is the largest.  The fit therefore includes the neighbours of the
    same peak, up to `MAX_PEAK_NEIGHBOURS`.  It is repeated around its vertex until the vertex stays at one lag.
    """
    i = int(c.argmax())
    for _ in range(len(c)):
        near = reach(c, i)
        if c[i] < MIN_CORRELATION or near < 1:
            return float("nan")
        k = np.arange(-near, near + 1)
        curvature, slope, _ = np.polyfit(k, c[i + k], 2).tolist()
        if curvature >= 0.0:
            return float("nan")
        vertex = -0.5 * slope / curvature
        if abs(vertex) <= 1.0:
            break
        i = int(np.clip(i + np.sign(vertex), 0, len(c) - 1))
    return float(step * (i - MAX_LAG_STEPS + vertex))


def reach(c: Array, i: int) -> int:
    """Number of lags on both sides of lag i that belong to its peak; 0 if lag i is no peak."""
    near = min(MAX_PEAK_NEIGHBOURS, i, len(c) - 1 - i)
    return next((k - 1 for k in range(1, near + 1) if min(c[i - k], c[i + k]) < 0.5 * c[i]), near)


def _rmse(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.concatenate(parts) ** 2, axis=1))))


def _bias(parts: list[Array]) -> float:
    return float(np.linalg.norm(np.concatenate(parts).mean(0)))


def _mean_rmse(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0)).mean())
