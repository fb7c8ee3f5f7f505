"""Tune the filter's noise to identification logs, by the likelihood of its innovations, and settle it for all logs."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.filters import ekf
from davinci_forces.filters.problem import NoiseModel, driven
from davinci_forces.filters.tuning import tuned
from davinci_forces.maths.signals.smoothing import noise_std
from davinci_forces.records import FilterNoise, JointModel, MeasurementNoise, Tuning

USUAL = ("rate", "r_q", "r_dq", "r_tau", "q_tau", "viscous", "speed")  # of which the median of all logs is taken
FINEST = 1e-9  # of a range: a noiseless log would leave innovations without a covariance to be judged by


def run(model: JointModel, noise: MeasurementNoise | None, *, lowpass: float) -> Iterator[Tuning]:
    """The Tuning of a joint that moves in an identification log, in which nothing touches the robot.  Section 7.3"""
    if model.role == "identification" and not model.at_rest and noise is not None:
        yield tuning(model, start(model, noise, lowpass))


def tuning(model: JointModel, before: NoiseModel) -> Tuning:
    """The noise of one joint of a log, and how much more likely it makes what was measured than where it began."""
    parts, T_s, inertia = driven(model), 1.0 / model.rate, float(model.inertia.max())
    noise = tuned(parts, before, inertia, model.viscous)
    began, ended = (
        sum(ekf.log_likelihood(part, n) for part in parts) for n in (before._replace(q_tau=noise.q_tau), noise)
    )
    return Tuning(
        log=model.log,
        joint=model.joint,
        rate=model.rate,
        r_q=noise.r_q,
        r_dq=noise.r_dq,
        r_tau=noise.q_dq * inertia / T_s,
        q_tau=noise.q_tau / T_s**0.5,
        inertia=inertia,
        viscous=model.viscous,
        speed=float(np.sqrt(np.mean(model.dq_measured**2))),
        likelihood_gain=ended - began,
        tested=len(model),
    )


def start(model: JointModel, between: MeasurementNoise, lowpass: float) -> NoiseModel:
    """What a low-pass takes out of each signal, so that what is slow, and no noise, does not count; the noise between
    periods where the sampling rate leaves it nothing to take out.  Section 6.3.3
    """
    pairs = (
        (model.q_measured, between.sigma_q),
        (model.dq_measured, between.sigma_dq),
        (model.tau - model.tau_hat, between.sigma_tau),
    )
    sizes = [
        max(noise_std(x, model.segment, model.rate, lowpass) or slow, FINEST * float(np.ptp(x)), 1e-12)
        for x, slow in pairs
    ]
    return NoiseModel(sizes[0], sizes[1], 0.0, sizes[2] / model.rate / float(model.inertia.mean()), 0.0)


def gather(tunings: Iterable[Tuning]) -> Iterator[FilterNoise]:
    """One FilterNoise per joint; the inertia is the largest, with which the filter is slowest."""
    every: dict[str, list[Tuning]] = {}
    for tuning in tunings:
        every.setdefault(tuning.joint, []).append(tuning)
    for joint, own in every.items():
        usual = {name: float(np.median([getattr(t, name) for t in own])) for name in USUAL}
        yield FilterNoise(joint=joint, logs=tuple(t.log for t in own), inertia=max(t.inertia for t in own), **usual)
