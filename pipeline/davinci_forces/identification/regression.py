"""Records as motions and regressions: averaged periods for fits, and recordings for predictions."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from davinci_forces.estimators.problem import NO_PRIOR, ROWS, Prior, Regression
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.models.physical import ROUNDING, Box
from davinci_forces.maths.periods.harmonics import kept_noise
from davinci_forces.maths.signals.smoothing import measured_motion
from davinci_forces.maths.signals.standstill import is_standing_still
from davinci_forces.records import Trajectory
from davinci_forces.records.recordings import FilteredMotion
from davinci_forces.robots.robot import Joint


def parameter_columns(model: Model, bodies: Bodies | None = None) -> dict[str, NDArray[Any]]:
    """What a Fit states of each parameter (p,) of a model, and what the robot's bodies, if known, say of it."""
    rows = [(p.name, p.typst, p.unit, p.combination, p.scale, float(p.positive)) for p in model.parameters]
    names = ("parameter", "phi", "unit", "combination", "scale", "positive")
    columns = zip(names, zip(*rows, strict=True), strict=True)
    of_bodies = model.of_bodies(bodies) if bodies and isinstance(model, CoupledArm) else np.full(len(rows), np.nan)
    texts_and_numbers = {name: np.array(x, object if isinstance(x[0], str) else float) for name, x in columns}
    return texts_and_numbers | {"described": of_bodies}


def pose(model: IndependentJoint, t: Trajectory, known: Prior = NO_PRIOR) -> Regression:
    """Return the least squares problem of a joint over the averaged period of a log.  (6.37)"""
    return Regression(
        Phi=model.regressor(averaged_motion(t)).Phi[:, 0],
        tau=t.tau,
        tau_var=t.tau_var,
        periods=np.where(stands_still(t), 0, t.count),  # at standstill, friction is undetermined
        starts=(0,),
        names=tuple(parameter.name for parameter in model.parameters),
        known=known,
        noise=t.tau_alternating,
        Phi_cov=row_covariance(model, t)[None],
    )


def stands_still(t: Trajectory) -> Booleans:
    """Return the samples (K,) of an averaged period at which the joint stands still; the period repeats."""
    q, dq = np.tile(t.q, 3), np.tile(t.dq, 3)
    return is_standing_still(q, dq, np.zeros(len(q), np.int64), len(t.q) / t.period)[len(t.q) : 2 * len(t.q)]


def row_covariance(model: IndependentJoint, t: Trajectory) -> Array:
    """Compute the mean covariance (p, p) of a row of Phi due to the noise of the averaged motion.

    cov(Phi_k) = J_k cov(q, dq, ddq) J_k' / M,    J_k the derivatives of Phi by the motion.
    """
    J = model.sensitivity(averaged_motion(t))
    noise = kept_noise(t.sigma_q, len(t.q), t.harmonics, 2 * np.pi / t.period) / t.periods
    return np.asarray(np.tensordot(J, noise @ J, axes=((0, 1), (0, 1))) / len(t.q))


def join_regressions(parts: Sequence[Regression]) -> Regression:
    """Return the least squares problem of several logs together; what is not known of one is not known of all."""
    starts = tuple(np.cumsum([0, *(len(p.tau) for p in parts[:-1])]).tolist())
    columns = {name: [getattr(p, name) for p in parts] for name in (*ROWS, "Phi_cov")}
    joined: dict[str, Any] = {
        name: None if any(x is None for x in xs) else np.concatenate(xs) for name, xs in columns.items()
    }
    return replace(parts[0], starts=starts, **joined)


def averaged_motion(trajectory: Trajectory) -> ArmMotion:
    """Return the motion of one averaged period of a joint, as a periodic motion."""
    q, dq, ddq = (x[:, None] for x in (trajectory.q, trajectory.dq, trajectory.ddq))
    return ArmMotion(q, dq, ddq, trajectory.period / len(q), np.zeros(len(q), np.int64), periodic=True)


def recorded_motion(record: FilteredMotion) -> ArmMotion:
    """Return the low-passed motion of a joint of one recording."""
    return ArmMotion(record.q[:, None], record.dq[:, None], record.ddq[:, None], 1.0 / record.rate, record.segment)


def motion_at(record: FilteredMotion, cutoff: float, effort_lag: float) -> ArmMotion:
    """Return the motion of a joint of one recording, low-passed at `cutoff` [Hz] and delayed by `effort_lag` [s]."""
    if (cutoff, effort_lag) == (record.cutoff, record.effort_lag):
        return recorded_motion(record)
    logged = record.dq_measured if record.velocity == "logged" else None
    delay = effort_lag - record.effort_lag
    q, dq, ddq = measured_motion(record.q_measured, logged, record.segment, record.rate, cutoff, delay)
    dq = np.where(record.dq == 0.0, 0.0, dq)  # where its sign is not known
    return ArmMotion(q[:, None], dq[:, None], ddq[:, None], 1.0 / record.rate, record.segment)


def joined_motion(motions: Sequence[ArmMotion]) -> ArmMotion:
    """Join the motions of several joints of one recording, in this order; the joints share a clock."""
    if len(motions) == 1:
        return motions[0]
    q, dq, ddq = (np.concatenate(columns, axis=1) for columns in zip(*(m[:3] for m in motions), strict=True))
    return motions[0]._replace(q=q, dq=dq, ddq=ddq)


def known_of(joint: Joint) -> Prior:
    """Return the signs that physics requires, and the box of physical parameters with a guess if the robot has one."""
    positive = np.array([term.positive for term in joint.terms])
    if joint.physical is None or joint.dependence is None or joint.effort:  # a current does not determine an effort
        return Prior(positive)
    guess, lower, upper = np.array([(x.guess, x.lower, x.upper) for x in joint.physical.parameters]).T
    theta = joint.dependence.theta(guess)
    # A difference of masses that is only rounding is no guess, because a guess is trusted to all its digits.
    return Prior(positive, Box(lower, upper, joint.dependence), np.where(np.abs(theta) > ROUNDING, theta, 0.0))
