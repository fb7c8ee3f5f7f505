"""Tune the filter noise of every joint by the likelihood of the innovations, log by log, and take the median."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.filters import DEFAULT, ekf, tracker
from davinci_forces.filters.problem import NoiseModel, filter_inputs
from davinci_forces.filters.response import smallest_q_tau, steady_std, tune_noise
from davinci_forces.maths.signals.smoothing import noise_std
from davinci_forces.records import FilterNoise, JointModel, MeasurementNoise, Tuning, by_name

POOLED = ("rate", "r_q", "r_dq", "r_tau", "q_tau", "viscous")  # fields that are pooled by the median
TRIAL_DELAYS = (0.02, 0.05, 0.1, 0.2, 0.4)  # [s]
MIN_NOISE = 1e-9  # over the range of a signal: without noise, the innovations' covariance would be singular


def run(model: JointModel, noise: MeasurementNoise | None, *, lowpass: float, delay: float) -> Iterator[Tuning]:
    """Tune the filter to a moving joint in an identification log, where nothing touches the robot.  Section 7.3"""
    if model.role != "identification" or model.at_rest or noise is None:
        return
    parts = [part.part(slice(0, part.samples)) for part in filter_inputs(model)]
    T_s, inertia = 1.0 / model.rate, float(model.inertia.max())
    before = initial_noise(model, noise, lowpass)
    tuned = tune_noise(parts, before, inertia, model.viscous, delay)
    initial, final = (
        sum(ekf.log_likelihood(part, n) for part in parts) for n in (before._replace(q_tau=tuned.q_tau), tuned)
    )
    yield Tuning.like(
        tuned, model, r_tau=tuned.q_dq * inertia / T_s, q_tau=tuned.q_tau / T_s**0.5, inertia=inertia,
        likelihood_gain=final - initial, tested=len(model),
    )  # fmt: skip


def initial_noise(model: JointModel, between: MeasurementNoise, lowpass: float) -> NoiseModel:
    """Estimate the noise of each signal as the part that a low-pass removes, so that slow errors are excluded.

    If the sampling rate leaves no band above the low-pass, the noise is the noise `between` periods.  Section 6.3.3
    """
    pairs = (
        (model.q_measured, between.sigma_q),
        (model.dq_measured, between.sigma_dq),
        (model.tau - model.tau_hat, between.sigma_tau),
    )
    sizes = [
        max(noise_std(x, model.segment, model.rate, lowpass) or slow, MIN_NOISE * float(np.ptp(x)), 1e-12)
        for x, slow in pairs
    ]
    return NoiseModel(sizes[0], sizes[1], 0.0, sizes[2] / model.rate / float(model.inertia.mean()), 0.0)


def gather(tunings: Iterable[Tuning], *, delay: float) -> Iterator[FilterNoise]:
    """Pool the filter noise of each joint: the median over its identification logs.

    The inertia is the largest one, because the filter is slowest with it.
    """
    for joint, ts in by_name(tunings, "joint").items():
        medians = {name: float(np.median([getattr(t, name) for t in ts])) for name in POOLED}
        inertia, trials = max(t.inertia for t in ts), np.array(TRIAL_DELAYS)
        T_s, viscous = 1.0 / medians["rate"], medians["viscous"]
        noise = NoiseModel(medians["r_q"], medians["r_dq"], 0.0, medians["r_tau"] * T_s / inertia, 0.0)
        walks = (smallest_q_tau(tracker(DEFAULT), inertia, viscous, T_s, noise, trial) for trial in TRIAL_DELAYS)
        std = np.array([steady_std(inertia, viscous, T_s, noise._replace(q_tau=walk)) for walk in walks])
        logs = tuple(t.log for t in ts)
        yield FilterNoise(
            joint=joint, logs=logs, delay=delay, inertia=inertia, trial_delay=trials, trial_std=std, **medians
        )
