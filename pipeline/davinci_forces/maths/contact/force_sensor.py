"""How far an estimated force is from that of a force sensor, and how much later the sensor shows it.

e = f_hat - f_s,    relative error = sum_i rms(e_i) / sum_i (max f_s,i - min f_s,i)

over the components i, which is how Yang et al. (2024, arXiv:2405.07453) state theirs.  The lag is where the correlation
c(d) = sum f_hat(t) f_s(t + d) / sqrt(sum f_hat(t)^2 sum f_s(t + d)^2) of both, less their means, is largest.  Standard
errors are by block bootstrap.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.mechanics.tip_force import CHI_SQUARED_95
from davinci_forces.maths.uncertainty.bootstrap import blocks, standard_error
from davinci_forces.maths.uncertainty.error_band import NORMAL_95

STEPS = 25  # of a lag to either side, at most
STEP = 0.01  # [s] between lags that are tried, at least: smooth forces tell the rest by a parabola
NEAR = 10  # lags to either side of the largest correlation that tell where it is
ALIKE = 0.5  # correlation below which both do not show one force, and no lag is told


class ForceErrors(NamedTuple):
    """The errors of an estimated force, or of one component: in its unit, as a share of the range, in time."""

    rmse: float
    rmse_std: float
    bias: float  # of a vector, the size of its mean error
    bias_std: float
    largest: float
    span: float  # of what the sensor shows, the mean over components
    relative: float
    relative_std: float
    coverage: float  # share of samples whose 95 % band holds what the sensor shows
    coverage_std: float


def at(t: Array, clock: Array, f: Array, reach: float) -> Array:
    """What a sensor (M, k) on its clock (M,) shows at times (N,): on a line between samples, NaN where none are near.

    `reach` [s] is how far apart samples may be for that.
    """
    after = np.clip(np.searchsorted(clock, t), 1, len(clock) - 1)
    gap = (clock[after] - clock[after - 1] > reach) & (t != clock[after])
    outside = (t < clock[0]) | (t > clock[-1])
    shown = np.stack([np.interp(t, clock, column) for column in f.T], axis=-1)
    shown[gap | outside] = np.nan
    return shown


def errors(estimated: Array, C: Array, measured: Array) -> ForceErrors:
    """The errors of a force (N, k) with covariance (N, k, k), against what a sensor shows (N, k)."""
    e, k = estimated - measured, measured.shape[1]
    spans = np.ptp(measured, axis=0)
    limit = {1: NORMAL_95**2, 3: CHI_SQUARED_95}[k]
    inside = np.einsum("ni,ni->n", e, np.linalg.solve(C, e[..., None])[..., 0]) <= limit
    parts = blocks(len(e))
    errors_of, held = [e[part] for part in parts], [inside[part].astype(float)[:, None] for part in parts]
    share = float(np.mean(inside))
    span = float(spans.mean())
    values = [(f(errors_of), standard_error(f, errors_of)) for f in (_rmse, _bias, _mean_rmse)]
    (rmse, rmse_std), (bias, bias_std), (typical, typical_std) = values
    relative, relative_std = (x / span if span else float("nan") for x in (typical, typical_std))
    if k == 1:
        bias = float(e.mean())
    largest = float(np.linalg.norm(e, axis=1).max())
    return ForceErrors(
        rmse, rmse_std, bias, bias_std, largest, span, relative, relative_std, share, standard_error(_bias, held)
    )


class Lag(NamedTuple):
    """How much later one of two forces comes [s], NaN where they are not alike."""

    value: float
    std: float


def lag(t: Array, estimated: Array, clock: Array, measured: Array, rate: float, judged: Booleans) -> Lag:
    """How much later a sensor (M, k) on its clock (M,) shows the force that is estimated (N, k) at times (N,).

    `judged` (N,) says which samples tell; `rate` [Hz] is that of the estimate.
    """
    step = np.ceil(STEP * rate - 1e-9) / rate
    lags = step * np.arange(-STEPS, STEPS + 1)
    f, parts = estimated[judged] - estimated[judged].mean(0), blocks(int(judged.sum()))
    mean, products = measured.mean(0), np.zeros((len(parts), len(lags), 3))
    for j, late in enumerate(lags.tolist()):
        shown = at(t[judged] + late, clock, measured, 3.0 / rate) - mean
        known = np.isfinite(shown).all(1)
        sums = [np.where(known, np.einsum("ni,ni->n", a, b), 0.0) for a, b in ((f, shown), (f, f), (shown, shown))]
        products[:, j] = [[float(total[part].sum()) for total in sums] for part in parts]

    def peak(of: list[Array]) -> float:
        both, own, its = np.sum(of, axis=0).T
        return _vertex(both / np.sqrt(np.maximum(own * its, 1e-300)), step)

    found = list(products)
    return Lag(peak(found), standard_error(peak, found))


def _vertex(c: Array, step: float) -> float:
    """The lag of the largest correlation: where the parabola through it and its neighbours to both sides turns.

    Noise makes the largest of nearly equal correlations any of them; as many neighbours as belong to the same peak, up
    to `NEAR`, tell better.  The parabola is put about its own vertex until it stays there.
    """
    i = int(c.argmax())
    for _ in range(len(c)):
        near = reach(c, i)
        if c[i] < ALIKE or near < 1:
            return float("nan")
        k = np.arange(-near, near + 1)
        curvature, slope, _ = np.polyfit(k, c[i + k], 2).tolist()
        if curvature >= 0.0:
            return float("nan")
        between = -0.5 * slope / curvature
        if abs(between) <= 1.0:
            break
        i = int(np.clip(i + np.sign(between), 0, len(c) - 1))
    return float(step * (i - STEPS + between))


def reach(c: Array, i: int) -> int:
    """How many lags to both sides of lag i still belong to its peak; 0 where it is none."""
    near = min(NEAR, i, len(c) - 1 - i)
    below = [k for k in range(1, near + 1) if min(c[i - k], c[i + k]) < 0.5 * c[i]]
    return below[0] - 1 if below else near


def _rmse(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.concatenate(parts) ** 2, axis=1))))


def _bias(parts: list[Array]) -> float:
    return float(np.linalg.norm(np.concatenate(parts).mean(0)))


def _mean_rmse(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0)).mean())
