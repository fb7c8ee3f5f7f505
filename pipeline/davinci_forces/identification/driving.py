"""A recording of one joint as a filter takes it, with what a fit says of the joint along it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import PipelineError
from davinci_forces.identification.regression import measured_motion, of_joints, predicted
from davinci_forces.identification.used import FALLBACK, describing, model_of, used
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.models.model import JointDynamics, Motion
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import Choice, Fit, Signal
from davinci_forces.robots.robot import Robot

Motions = dict[str, Motion]  # by joint


class Driving(NamedTuple):
    """One joint of a log, under a fit: (N,) samples."""

    signal: Signal
    fit: Fit
    joint: JointDynamics
    motion: tuple[Array, Array, Array]  # q, dq and ddq, low-passed without delay
    tau_hat: Array

    @property
    def parts(self) -> list[Driven]:
        """Its segments as recorded; a gap starts a filter anew."""
        return self._parts(self.signal.q, self.signal.dq)

    @property
    def smooth_parts(self) -> list[Driven]:
        """The same with the motion low-passed."""
        return self._parts(*self.motion[:2])

    def _parts(self, q: Array, dq: Array) -> list[Driven]:
        s = self.signal
        whole = Driven(self.joint, q, dq, self.motion[2], s.tau, 1.0 / s.rate, float(np.std(s.tau)) or 1.0)
        return [whole.part(part) for part in segments(s.segment)]

    def by(self, tau_hat: Array) -> "Driving":
        """The same joint, but for an effort (N,) that another fit gives for it."""
        return self._replace(
            joint=self.joint._replace(known=self.joint.known + tau_hat - self.tau_hat), tau_hat=tau_hat
        )


def motions_of(signals: Sequence[Signal], lowpass: float) -> Motions:
    """The measured motion of every joint of a log, once for all that is driven by it."""
    return {signal.joint: measured_motion(signal, lowpass) for signal in signals}


def driving(signal: Signal, motions: Motions, fit: Fit, robot: Robot) -> Driving:
    """A joint of a log that holds all the joints that the fit needs the motion of."""
    model = model_of(robot, fit)
    motion = of_joints([motions[name] for name in model.joints])
    row, place = model.efforts.index(signal.joint), model.joints.index(signal.joint)
    dynamics = model.joint_dynamics(fit.theta, motion)[row]
    own = (motion.q[:, place], motion.dq[:, place], motion.ddq[:, place])
    return Driving(signal, fit, dynamics, own, predicted(model, fit.theta, motion, row))


def named(
    signal: Signal, signals: Sequence[Signal], fits: Sequence[Fit], choices: Sequence[Choice], robot: Robot, fit: str
) -> tuple[Fit, str]:
    """The fit that a joint of a log is tracked with, and why it is not the one that is named where it is not.

    Raises
    ------
    PipelineError
        If there is no fit of that name.
    """
    own = describing(robot, fits, signal.joint)
    kept = used(robot, own, choices, signal.joint, fit)
    if kept is None:
        there = ", ".join(f"{f.model}.{f.estimator}" for f in own)
        raise PipelineError(f"{signal.joint}: there is no fit {fit!r}; set fit in [settings] to one of {there}")
    stand_in = used(robot, own, (), signal.joint, FALLBACK)
    if stand_in is None or set(model_of(robot, kept).joints) <= {s.joint for s in signals if len(s) == len(signal)}:
        return kept, ""
    needs = f"the log does not hold the other joints that {kept.model}.{kept.estimator} needs"
    return stand_in, f"{needs}, so {FALLBACK} is used; add their channels"
