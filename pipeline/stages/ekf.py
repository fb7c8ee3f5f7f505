"""Track the external effort on every joint of every log with an extended Kalman filter."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pipeline.errors import PipelineError
from pipeline.estimators.regression import measured_motion, of_joints, predicted
from pipeline.estimators.used import FALLBACK, describing, model_of, used
from pipeline.filters import tracker
from pipeline.filters.problem import NoiseModel, Tracked
from pipeline.maths.arrays import Array
from pipeline.maths.models.model import JointDynamics
from pipeline.maths.signals.smoothing import segments
from pipeline.maths.signals.windows import outside, settled
from pipeline.records import Choice, Column, Diagnostic, Fit, MeasurementNoise, Signal, Track, diagnostic
from pipeline.robots.robot import Robot
from pipeline.study import LogEntry

FILTER = "ekf"


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
    every, chosen, by_joint = list(fits), list(choices), {noise.joint: noise for noise in noises}
    for signal in signals:
        own, noise = describing(robot, every, signal.joint), by_joint.get(signal.joint)
        if not own or noise is None:
            name = f"{signal.log}/{signal.joint}"
            said = f"{name}: no identification log moves this joint, so its external effort is not tracked"
            yield diagnostic("ekf", f"{signal.log}.{signal.joint}", "note", said)
            continue
        kept, said = named(signal, signals, own, chosen, robot, fit)
        if said:
            yield diagnostic("ekf", f"{signal.log}.{signal.joint}", "note", f"{signal.log}/{signal.joint}: {said}")
        yield from of_joint(signal, signals, kept, noise, entry, robot, lowpass, q_tau)


def named(
    signal: Signal, signals: Sequence[Signal], own: Sequence[Fit], choices: Sequence[Choice], robot: Robot, fit: str
) -> tuple[Fit, str]:
    """The fit that a joint of a log is tracked with, and why it is not the one that is named where it is not."""
    kept = used(robot, own, choices, signal.joint, fit)
    if kept is None:
        there = ", ".join(f"{f.model}.{f.estimator}" for f in own)
        raise PipelineError(f"{signal.joint}: there is no fit {fit!r}; set fit in [settings] to one of {there}")
    stand_in = used(robot, own, (), signal.joint, FALLBACK)
    if stand_in is None or set(model_of(robot, kept).joints) <= {s.joint for s in signals if len(s) == len(signal)}:
        return kept, ""
    needs = f"the log does not hold the other joints that {kept.model}.{kept.estimator} needs"
    return stand_in, f"{needs}, so {FALLBACK} is used; add their channels"


def of_joint(
    signal: Signal,
    signals: Sequence[Signal],
    fit: Fit,
    between_periods: MeasurementNoise,
    entry: LogEntry,
    robot: Robot,
    lowpass: float,
    q_tau: float,
) -> Iterator[Track | Diagnostic]:
    """The Track of one joint of a log."""
    joint, model = robot.joint(signal.joint), model_of(robot, fit)
    motions = {s.joint: measured_motion(s, lowpass) for s in signals if s.joint in model.joints}
    motion = of_joints([motions[name] for name in model.joints])
    row, place = model.efforts.index(joint.name), model.joints.index(joint.name)
    dynamics = model.joint_dynamics(fit.theta, motion)[row]
    if dynamics.inertia.min() <= 0:
        yield diagnostic(
            "ekf", f"{signal.log}.{joint.name}", "warning",
            f"{signal.log}/{joint.name}: the fit's inertia is not positive, so no motion follows from it and nothing "
            "is tracked; check the signs of the effort and of the position",
        )  # fmt: skip
        return
    q_tau = q_tau or joint.q_tau
    noise = assumed(between_periods, dynamics, motion.ddq[:, place], signal, q_tau)
    tau_hat = predicted(model, fit.theta, motion, row)
    yield tracked(signal, fit, dynamics, tau_hat, noise, entry, q_tau)


def assumed(
    between_periods: MeasurementNoise, dynamics: JointDynamics, ddq: Array, signal: Signal, q_tau: float
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
