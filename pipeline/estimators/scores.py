"""How well an effort was predicted, on one footing: raw, and with effort and prediction through the same low-pass."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from pipeline.maths.arrays import Array, Booleans
from pipeline.maths.signals.noise import model_error, noise_std, smoothed
from pipeline.maths.signals.smoothing import share_passed
from pipeline.records import Prediction, Signal, Smoothed

AnySignal = TypeVar("AnySignal", Signal, Smoothed)

FIRST = 1111  # samples that the published rival's errors are over


def scored(
    signal: Signal | Smoothed,
    model: str,
    name: str,
    role: str,
    scheme: str,
    path: str,
    tau_hat: Array,
    free: Booleans,
    lowpass: float,
    white: float | None = None,
) -> Prediction:
    """A prediction with its scores, over some of the samples (N,): where nothing touched the robot.

    `white` is the noise of the effort where periods tell it; else it is what a low-pass takes out of the error, which
    holds a ripple of the drive as well.
    """
    tau, error = signal.tau[free], (signal.tau - tau_hat)[free]
    spread = tau - tau.mean()
    smooth, smooth_error = (
        smoothed(x, signal.segment, signal.rate, lowpass)[free] for x in (signal.tau, signal.tau - tau_hat)
    )
    rmse = float(np.sqrt(np.mean(error**2)))
    unexplained = float(np.linalg.norm(error) / (np.linalg.norm(spread) or 1.0))
    noise = noise_std(signal.tau - tau_hat, signal.segment, signal.rate, lowpass) if white is None else white
    beyond_noise, beyond_noise_std = model_error(smooth_error, noise * np.sqrt(share_passed(signal.rate, lowpass)))
    return Prediction(
        log=signal.log,
        joint=signal.joint,
        model=model,
        estimator=name,
        role=role,
        scheme=scheme,
        path=path,
        rmse=rmse,
        nrmse=rmse / float(np.ptp(tau) or 1.0),
        r2=float(1 - error @ error / ((spread @ spread) or 1.0)),
        fit_percent=100.0 * (1.0 - unexplained),
        r2_ceiling=1.0 - noise**2 / (float(tau.var()) or 1.0),
        model_error=beyond_noise,
        model_error_std=beyond_noise_std,
        effort_rms=float(np.sqrt(np.mean(smooth**2))),
        relative_error=relative(smooth_error, smooth),
        relative_error_1111=relative(smooth_error[:FIRST], smooth[:FIRST]),
        t=signal.t,
        tau=signal.tau,
        tau_hat=tau_hat,
    )


def some(signal: AnySignal, which: Booleans | slice) -> AnySignal:
    """Some of the samples (N,) of a recording."""
    return replace(signal, **{name: getattr(signal, name)[which] for name in signal.columns()})


def relative(error: Array, tau: Array) -> float:
    """The norm of an error (N,) over that of the effort (N,)."""
    return float(np.linalg.norm(error) / (np.linalg.norm(tau) or 1.0))
