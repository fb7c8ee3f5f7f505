"""Records as regressions: averaged periods to be fitted, and recordings whose effort is to be predicted."""

from collections.abc import Sequence

import numpy as np

from pipeline.estimators.problem import Regression
from pipeline.maths.models.dynamics import regressor
from pipeline.maths.signals.smoothing import motion, segments
from pipeline.records import Column, Signal, Trajectory
from pipeline.robots.robot import Joint

MODEL = "independent"  # each joint by itself, section 6.1


def pose(trajectories: Sequence[Trajectory], joint: Joint) -> Regression:
    """The least squares problem of one joint: the averaged periods of all its logs, one after the other.  (6.37)"""
    lengths = [len(t) for t in trajectories]
    return Regression(
        Phi=np.vstack([regressor(joint.terms, t.q, t.dq, t.ddq) for t in trajectories]),
        tau=np.concatenate([t.tau for t in trajectories]),
        tau_var=np.concatenate([t.tau_var for t in trajectories]),
        periods=np.concatenate([t.count for t in trajectories]),
        starts=tuple(np.cumsum([0, *lengths[:-1]]).tolist()),
        names=tuple(term.name for term in joint.terms),
    )


def measured_regressor(signal: Signal, joint: Joint, lowpass: float) -> Column:
    """Phi (N, p) of a recording that need not repeat, from low-passed motion."""
    rows = []
    for part in segments(signal.segment):
        rows.append(regressor(joint.terms, *motion_of(signal, part, lowpass)))
    return np.vstack(rows)


def motion_of(signal: Signal, part: slice, lowpass: float) -> tuple[Column, Column, Column]:
    """Low-passed position, velocity and acceleration of one segment of a recording."""
    dq = signal.dq[part] if signal.velocity == "logged" else None
    return motion(signal.q[part], dq, signal.rate, lowpass)
