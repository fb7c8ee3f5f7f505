"""Tune the filter's noise to identification logs: that of the greatest likelihood of its innovations."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters import ekf
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.tuning import tuned
from davinci_forces.identification.driving import Driving, driving, motions_of, named
from davinci_forces.identification.used import describing
from davinci_forces.maths.models.bias import VISCOUS
from davinci_forces.maths.signals.noise import noise_std
from davinci_forces.records import Choice, Diagnostic, Fit, MeasurementNoise, Signal, Tuning, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

FINEST = 1e-9  # of a range: a noiseless log would leave innovations without a covariance to be judged by


def run(
    signals: Sequence[Signal],
    fits: Iterable[Fit],
    choices: Iterable[Choice],
    noises: Iterable[MeasurementNoise],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
) -> Iterator[Tuning | Diagnostic]:
    """One Tuning per joint that moves in an identification log, in which nothing touches the robot.  Section 7.3"""
    if entry.role != "identification":
        return
    every, chosen, between = list(fits), list(choices), {noise.joint: noise for noise in noises}
    motions = motions_of(signals, lowpass)
    for signal in signals:
        if signal.at_rest or not describing(robot, every, signal.joint) or signal.joint not in between:
            continue
        kept, _ = named(signal, signals, every, chosen, robot, fit)
        own = driving(signal, motions, kept, robot)
        if own.joint.inertia.min() <= 0:
            yield not_positive(signal, kept)
            continue
        yield tuning(own, start(own, between[signal.joint], lowpass))


def tuning(own: Driving, before: NoiseModel) -> Tuning:
    """The noise of one joint of a log, and how much more likely it makes what was measured than where it began."""
    parts, T_s, inertia = own.parts, 1.0 / own.signal.rate, float(own.joint.inertia.max())
    viscous = own.joint.coefficients[VISCOUS]
    noise = tuned(parts, before, inertia, viscous)
    began, ended = (
        sum(ekf.log_likelihood(part, n) for part in parts) for n in (before._replace(q_tau=noise.q_tau), noise)
    )
    return Tuning(
        log=own.signal.log,
        joint=own.signal.joint,
        rate=own.signal.rate,
        r_q=noise.r_q,
        r_dq=noise.r_dq,
        r_tau=noise.q_dq * inertia / T_s,
        q_tau=noise.q_tau / T_s**0.5,
        inertia=inertia,
        viscous=viscous,
        speed=float(np.sqrt(np.mean(own.signal.dq**2))),
        likelihood_gain=ended - began,
        tested=len(own.signal),
    )


def start(own: Driving, between: MeasurementNoise, lowpass: float) -> NoiseModel:
    """What a low-pass takes out of each signal, so that what is slow, and no noise, does not count; the noise between
    periods where the sampling rate leaves it nothing to take out.  Section 6.3.3
    """
    s = own.signal
    pairs = ((s.q, between.sigma_q), (s.dq, between.sigma_dq), (s.tau - own.tau_hat, between.sigma_tau))
    sizes = [
        max(noise_std(x, s.segment, s.rate, lowpass) or slow, FINEST * float(np.ptp(x)), 1e-12) for x, slow in pairs
    ]
    return NoiseModel(sizes[0], sizes[1], 0.0, sizes[2] / s.rate / float(own.joint.inertia.mean()), 0.0)


def not_positive(signal: Signal, fit: Fit) -> Diagnostic:
    """Why nothing is tracked."""
    name = f"{signal.log}/{signal.joint}"
    said = (
        f"{name}: the inertia of {fit.model}.{fit.estimator} is not positive, so no motion follows from it and nothing "
        f"is tracked; what `fit` says of {signal.joint} tells why: a motion that hardly excites it, a sign, other "
        "joints that move in the same logs, or what the model leaves out"
    )
    return diagnostic("tune", f"{signal.log}.{signal.joint}", "warning", said)
