"""Track the external effort on every joint of every log with an extended Kalman filter."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, rts, through
from davinci_forces.filters.assumed import assumed
from davinci_forces.filters.error_bands import ModelVariance, model_variance
from davinci_forces.filters.lag import lag
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.response import rise
from davinci_forces.identification.driving import Driving, driving, motions_of, named
from davinci_forces.identification.paths import ANOTHER_PATH, SAME_PATH, follows
from davinci_forces.identification.used import describing
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.maths.signals.windows import free_space, settled
from davinci_forces.maths.uncertainty.day_offset import DayOffset, day_offset
from davinci_forces.records import (
    Choice,
    Diagnostic,
    ErrorBand,
    FilterNoise,
    Fit,
    FittedPaths,
    Signal,
    Track,
    diagnostic,
)
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry


def run(
    signals: Sequence[Signal],
    fits: Iterable[Fit],
    choices: Iterable[Choice],
    noises: Iterable[FilterNoise],
    bands: Iterable[ErrorBand],
    paths: Iterable[FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
    q_tau: float,
) -> Iterator[Track | Diagnostic]:
    """The filter's pass over each joint of a log, with the fit that the setting names, or the chosen one.

    What the fit says of other joints and of friction's memory, the filter knows from the measured motion.  (7.6)-(7.16)

    Raises
    ------
    PipelineError
        If there is no fit of that name.
    """
    if entry.role == "friction":
        return
    every, chosen = list(fits), list(choices)
    noise_of, band_of = {noise.joint: noise for noise in noises}, {band.joint: band for band in bands}
    path_of = {path.joint: path for path in paths}
    motions = motions_of(signals, lowpass)
    for signal in signals:
        about, name = f"{signal.log}.{signal.joint}", f"{signal.log}/{signal.joint}"
        if not describing(robot, every, signal.joint) or signal.joint not in noise_of:
            said = "no identification log moves this joint, so its external effort is not tracked"
            yield diagnostic("ekf", about, "note", f"{name}: {said}")
            continue
        kept, said = named(signal, signals, every, chosen, robot, fit)
        if said:
            yield diagnostic("ekf", about, "note", f"{name}: {said}")
        own = driving(signal, motions, kept, robot)
        if own.joint.inertia.min() <= 0:
            said = f"{name}: nothing is tracked: the inertia of {kept.model}.{kept.estimator} is not positive along it"
            yield diagnostic("ekf", about, "warning", f"{said}; see what is said of tuning")
            continue
        path = path_of.get(signal.joint)
        fitted = entry.role == "identification" or (path is not None and follows(signal, path))
        noise = assumed(noise_of[signal.joint], robot.joint(signal.joint), 1.0 / signal.rate, q_tau)
        yield from tracked(own, noise, band_of.get(signal.joint), SAME_PATH if fitted else ANOTHER_PATH, entry)


def tracked(
    own: Driving, noise: NoiseModel, band: ErrorBand | None, path: str, entry: LogEntry
) -> Iterator[Track | Diagnostic]:
    """The Track of one joint of a log."""
    signal, parts = own.signal, own.parts
    made = through(DEFAULT, parts, noise)
    if diverges(made):
        yield diverged(signal, float(np.mean(made.nis)))
        if not np.isfinite(made.tau_ext).all():
            return
    smooth, late = lag(parts, noise)
    offset = day_offset(signal.t, signal.tau - own.tau_hat, entry.free)
    if offset.drifts:
        yield drifting(signal, offset)
    beyond = ModelVariance(np.zeros(len(signal)), np.zeros(len(signal)), "")
    if band is not None:
        beyond = model_variance(band, signal.log, path, signal.dq, bool(entry.free))
    total = made.tau_ext_std**2 + beyond.variance + late**2 + offset.std**2
    calm = np.concatenate([settled(signal.t[part]) for part in segments(signal.segment)])
    free = free_space(signal.t, entry.contact, signal.rate)
    model_part = float(np.sqrt(np.mean(beyond.variance)))
    yield Track(
        log=signal.log,
        joint=signal.joint,
        model=own.fit.model,
        estimator=own.fit.estimator,
        filter=DEFAULT,
        role=signal.role,
        path=path,
        at_rest=signal.at_rest,
        rate=signal.rate,
        tau_ext_rms=rms((made.tau_ext - offset.value)[free]),
        nis_mean=float(np.mean(made.nis[calm])),
        r_q=noise.r_q,
        r_dq=noise.r_dq,
        q_dq=noise.q_dq,
        q_tau=noise.q_tau * signal.rate**0.5,
        day_offset=offset.value,
        day_offset_std=offset.std,
        filter_part=rms(made.tau_ext_std[calm]),
        model_part=model_part,
        model_part_std=float(np.sqrt(model_part**2 + np.mean(beyond.std))) - model_part,
        lag_part=rms(late[calm]),
        smooth_rise=rise(rts.track, parts[0], noise),
        band_from=beyond.told_by,
        t=signal.t,
        q=made.q,
        dq=made.dq,
        tau=signal.tau,
        tau_hat=own.tau_hat,
        tau_ext=made.tau_ext - offset.value,
        tau_ext_std=np.sqrt(total),
        tau_ext_std_filter=made.tau_ext_std,
        tau_ext_smooth=smooth - offset.value,
        tau_ext_direct=signal.tau - own.tau_hat - offset.value,
        innovation_q=made.innovation_q,
        innovation_dq=made.innovation_dq,
        nis=made.nis,
    )


def rms(x: Array) -> float:
    """Root mean square, NaN of nothing."""
    return float(np.sqrt(np.mean(x**2))) if len(x) else float("nan")


def diverged(signal: Signal, nis: float) -> Diagnostic:
    """A filter whose innovations are nothing like what it assumes."""
    said = (
        f"{signal.log}/{signal.joint}: the filter's innovations are {np.sqrt(nis / 2.0):.3g} times what it assumes: "
        "the measured motion does not follow from the effort; check the units, signs and clock of its channels, and "
        "whether a sensor was stuck"
    )
    return diagnostic("ekf", f"{signal.log}.{signal.joint}", "warning", said)


def drifting(signal: Signal, offset: DayOffset) -> Diagnostic:
    """An offset that is not the same in all that is said to be free."""
    said = (
        f"{signal.log}/{signal.joint}: the offset drifts within the free windows by {offset.drift:.3g}, with a "
        f"standard error of {offset.drift_std:.2g}; shorten the log, or state a free window nearer to the contact"
    )
    return diagnostic("ekf", f"{signal.log}.{signal.joint}", "warning", said)
