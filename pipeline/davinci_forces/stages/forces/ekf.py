"""Track the external effort on every joint of every log with an extended Kalman filter."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, rts, through
from davinci_forces.filters.error_bands import ModelVariance, model_variance
from davinci_forces.filters.problem import NoiseModel, driven
from davinci_forces.filters.response import assumed, lag, rise
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.maths.signals.windows import free_space, settled
from davinci_forces.maths.uncertainty.day_offset import DayOffset, day_offset
from davinci_forces.records import Diagnostic, ErrorBand, FilterNoise, JointModel, Track, diagnostic
from davinci_forces.robots.robot import Joint
from davinci_forces.study import LogEntry


def run(
    model: JointModel,
    noise: FilterNoise | None,
    band: ErrorBand | None,
    entry: LogEntry,
    joint: Joint,
    *,
    q_tau: float,
) -> Iterator[Track | Diagnostic]:
    """The filter's pass over a joint of a log.

    What the fit says of other joints and of friction's memory, the filter knows from the measured motion.  (7.6)-(7.16)
    """
    if noise is not None:
        yield from tracked(model, assumed(noise, joint, 1.0 / model.rate, q_tau), band, entry)
        return
    said = "no identification log tells the noise that the filter assumes, so its external effort is not tracked"
    yield diagnostic("ekf", f"{model.log}.{model.joint}", "note", f"{model.log}/{model.joint}: {said}")


def tracked(
    model: JointModel, noise: NoiseModel, band: ErrorBand | None, entry: LogEntry
) -> Iterator[Track | Diagnostic]:
    """The Track of one joint of a log."""
    parts = driven(model)
    made = through(DEFAULT, parts, noise)
    if diverges(made):
        yield diverged(model, float(np.mean(made.nis)))
        if not np.isfinite(made.tau_ext).all():
            return
    smooth, late = lag(parts, noise)
    smooth_rise = rise(rts.track, parts[0], noise)
    offset = day_offset(model.t, model.tau - model.tau_hat, entry.free)
    if offset.drifts:
        yield drifting(model, offset)
    beyond = ModelVariance(np.zeros(len(model)), np.zeros(len(model)), "")
    if band is not None:
        beyond = model_variance(band, model.log, model.path, model.dq_measured, bool(entry.free))
    total = made.tau_ext_std**2 + beyond.variance + late**2 + offset.std**2
    calm = np.concatenate([settled(model.t[part]) for part in segments(model.segment)])
    free = free_space(model.t, entry.contact, model.rate)
    model_part = float(np.sqrt(np.mean(beyond.variance)))
    yield Track(
        log=model.log,
        joint=model.joint,
        model=model.model,
        estimator=model.estimator,
        filter=DEFAULT,
        role=model.role,
        path=model.path,
        at_rest=model.at_rest,
        rate=model.rate,
        tau_ext_rms=rms((made.tau_ext - offset.value)[free]),
        nis_mean=float(np.mean(made.nis[calm])),
        r_q=noise.r_q,
        r_dq=noise.r_dq,
        q_dq=noise.q_dq,
        q_tau=noise.q_tau * model.rate**0.5,
        day_offset=offset.value,
        day_offset_std=offset.std,
        filter_part=rms(made.tau_ext_std[calm]),
        model_part=model_part,
        model_part_std=float(np.sqrt(model_part**2 + np.mean(beyond.std))) - model_part,
        lag_part=rms(late[calm]),
        smooth_rise=smooth_rise,
        band_from=beyond.told_by,
        t=model.t,
        q=made.q,
        dq=made.dq,
        tau=model.tau,
        tau_hat=model.tau_hat,
        tau_ext=made.tau_ext - offset.value,
        tau_ext_std=np.sqrt(total),
        tau_ext_std_filter=made.tau_ext_std,
        tau_ext_smooth=smooth - offset.value,
        tau_ext_direct=model.tau - model.tau_hat - offset.value,
        innovation_q=made.innovation_q,
        innovation_dq=made.innovation_dq,
        nis=made.nis,
    )


def rms(x: Array) -> float:
    """Root mean square, NaN of nothing."""
    return float(np.sqrt(np.mean(x**2))) if len(x) else float("nan")


def diverged(model: JointModel, nis: float) -> Diagnostic:
    """A filter whose innovations are nothing like what it assumes."""
    said = (
        f"{model.log}/{model.joint}: the filter's innovations are {np.sqrt(nis / 2.0):.3g} times what it assumes: "
        "the measured motion does not follow from the effort; check the units, signs and clock of its channels, and "
        "whether a sensor was stuck"
    )
    return diagnostic("ekf", f"{model.log}.{model.joint}", "warning", said)


def drifting(model: JointModel, offset: DayOffset) -> Diagnostic:
    """An offset that is not the same in all that is said to be free."""
    said = (
        f"{model.log}/{model.joint}: the offset drifts within the free windows by {offset.drift:.3g}, with a "
        f"standard error of {offset.drift_std:.2g}; shorten the log, or state a free window nearer to the contact"
    )
    return diagnostic("ekf", f"{model.log}.{model.joint}", "warning", said)
