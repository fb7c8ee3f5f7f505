"""Track the external effort on every joint of every log with an extended Kalman filter."""

from collections.abc import Iterable, Iterator

import numpy as np

from pipeline.errors import PipelineError
from pipeline.estimators.regression import measured_motion, predicted
from pipeline.filters import tracker
from pipeline.filters.problem import NoiseModel, Tracked
from pipeline.maths.models.model import JointDynamics, Motion
from pipeline.maths.signals.smoothing import segments
from pipeline.maths.signals.windows import outside, settled
from pipeline.records import Column, Diagnostic, Fit, MeasurementNoise, Signal, Track, diagnostic
from pipeline.robots.models import independent
from pipeline.robots.robot import Joint
from pipeline.study import LogEntry

FILTER = "ekf"


def run(
    signal: Signal,
    fits: Iterable[Fit],
    between_periods: MeasurementNoise | None,
    entry: LogEntry,
    joint: Joint,
    *,
    fit: str,
    lowpass: float,
    q_tau: float,
) -> Iterator[Track | Diagnostic]:
    """The filter's pass over one joint, with the Fit that the setting `fit` names.  (7.6)-(7.16)"""
    if entry.role == "friction":
        return
    own = [f for f in fits if f.group == joint.name]
    if not own or between_periods is None:
        yield diagnostic(
            "ekf", f"{signal.log}.{joint.name}", "note",
            f"{signal.log}/{joint.name}: no identification log moves this joint, so its external effort is not tracked",
        )  # fmt: skip
        return
    chosen = next((f for f in own if f"{f.model}.{f.estimator}" == fit), None)
    if chosen is None:
        there = ", ".join(f"{f.model}.{f.estimator}" for f in own)
        raise PipelineError(f"{joint.name}: there is no fit {fit!r}; set fit in [settings] to one of {there}")
    model, motion = independent(joint), measured_motion(signal, lowpass)
    [dynamics] = model.joint_dynamics(chosen.theta, motion)
    if dynamics.inertia.min() <= 0:
        yield diagnostic(
            "ekf", f"{signal.log}.{joint.name}", "warning",
            f"{signal.log}/{joint.name}: the fit's inertia is not positive, so no motion follows from it and nothing "
            "is tracked; check the signs of the effort and of the position",
        )  # fmt: skip
        return
    q_tau = q_tau or joint.q_tau
    noise = assumed(between_periods, dynamics, motion, signal, q_tau)
    tau_hat = predicted(model, chosen.theta, motion)
    yield tracked(signal, chosen, dynamics, tau_hat, noise, entry, q_tau)


def assumed(
    between_periods: MeasurementNoise, dynamics: JointDynamics, motion: Motion, signal: Signal, q_tau: float
) -> NoiseModel:
    """What the filter assumes of noise: all measured, except for the walk of the external effort.

    The measured effort drives the model, so its noise is process noise of the velocity, scaled by T_s / M.  Forward
    Euler leaves out half of T_s^2 times the next derivative in each step of position and velocity; encoders are often
    finer than that, so it is process noise, too.
    """
    T_s = 1.0 / signal.rate
    # A noiseless log would leave the innovations without a covariance to be judged by.
    r_q, r_dq = (
        max(r, 1e-9 * np.ptp(x), 1e-12)
        for r, x in ((between_periods.sigma_q, signal.q), (between_periods.sigma_dq, signal.dq))
    )
    ddq = motion.ddq[:, 0]
    euler_q, euler_dq = (0.5 * T_s**2 * float(np.sqrt(np.mean(x**2))) for x in (ddq, np.gradient(ddq, T_s)))
    driven = T_s * between_periods.sigma_tau / float(np.mean(dynamics.inertia))
    return NoiseModel(r_q, r_dq, euler_q, float(np.hypot(driven, euler_dq)), q_tau * np.sqrt(T_s))


def tracked(
    signal: Signal, fit: Fit, dynamics: JointDynamics, tau_hat: Column, noise: NoiseModel, entry: LogEntry, q_tau: float
) -> Track:
    """Filter every segment of a signal; a gap starts the filter anew."""
    first_std = max(float(np.std(signal.tau)), noise.q_tau)
    track = tracker(FILTER)
    passes = [
        track(
            dynamics._replace(inertia=dynamics.inertia[part], known=dynamics.known[part]),
            signal.q[part],
            signal.dq[part],
            signal.tau[part],
            1.0 / signal.rate,
            noise,
            first_std,
        )
        for part in segments(signal.segment)
    ]
    together = Tracked(*(np.concatenate(columns) for columns in zip(*passes, strict=True)))
    calm = np.concatenate([settled(signal.t[part]) for part in segments(signal.segment)])
    counted = outside(signal.t, entry.contact) & calm
    return Track(
        log=signal.log,
        joint=signal.joint,
        model=fit.model,
        estimator=fit.estimator,
        filter=FILTER,
        role=signal.role,
        at_rest=signal.at_rest,
        rate=signal.rate,
        tau_ext_rms=float(np.sqrt(np.mean(together.tau_ext[counted] ** 2))) if counted.any() else float("nan"),
        nis_mean=float(np.mean(together.nis[calm])),
        r_q=noise.r_q,
        r_dq=noise.r_dq,
        q_q=noise.q_q,
        q_dq=noise.q_dq,
        q_tau=q_tau,
        t=signal.t,
        q=together.q,
        dq=together.dq,
        tau=signal.tau,
        tau_hat=tau_hat,
        tau_ext=together.tau_ext,
        tau_ext_std=together.tau_ext_std,
        tau_ext_direct=signal.tau - tau_hat,
        innovation_q=together.innovation_q,
        innovation_dq=together.innovation_dq,
        nis=together.nis,
    )
