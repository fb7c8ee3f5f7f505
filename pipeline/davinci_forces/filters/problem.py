"""What every filter is asked, and what it answers."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import COEFFICIENTS, VISCOUS
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import JointModel


class Driven(NamedTuple):
    """(N,) samples each, in the joint's units; T_s [s].

    `ddq` is measured without delay, and `first_std` the deviation of the external effort before the first sample.
    """

    joint: JointDynamics
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    T_s: float
    first_std: float

    def part(self, which: slice) -> "Driven":
        """Some of the samples, in their order."""
        joint = self.joint._replace(inertia=self.joint.inertia[which], known=self.joint.known[which])
        q, dq, ddq, tau = (x[which] for x in (self.q, self.dq, self.ddq, self.tau))
        return Driven(joint, q, dq, ddq, tau, self.T_s, self.first_std)


def standing(inertia: Array, viscous: float, tau: Array, T_s: float, first_std: float) -> Driven:
    """A joint that stands still while its motor exerts an effort (N,) on the environment: a filter is linear there."""
    still = np.zeros(len(tau))
    coefficients = tuple(viscous if i == VISCOUS else 0.0 for i in range(len(COEFFICIENTS)))
    return Driven(JointDynamics(inertia, coefficients, still), still, still, still, tau, T_s, first_std)  # type: ignore[arg-type]


class NoiseModel(NamedTuple):
    """Standard deviations of the measurements, and of what each state gains from one sample to the next."""

    r_q: float
    r_dq: float
    q_q: float
    q_dq: float  # by an acceleration that is constant over the sample, which moves q by half of T_s q_dq
    q_tau: float  # of one step of the random walk


class Tracked(NamedTuple):
    """A filter's pass over (N,) samples: its state, how uncertain it is, and how surprising each sample was.

    A filter without innovations leaves them 0, and `nis`, too.
    """

    q: Array
    dq: Array
    tau_ext: Array
    tau_ext_std: Array
    innovation_q: Array
    innovation_dq: Array
    nis: Array


# track(recording, noise)
Filter = Callable[[Driven, NoiseModel], Tracked]


def driven(model: JointModel, tau_hat: Array | None = None) -> list[Driven]:
    """A joint of a log as filters take it: its segments as measured, as each gap starts a filter anew.

    `tau_hat` (N,) is the effort that another fit gives, where that is to be taken off.
    """
    known = model.tau_known if tau_hat is None else model.tau_known + (tau_hat - model.tau_hat)
    return _segments(model, model.q_measured, model.dq_measured, known)


def driven_smooth(model: JointModel) -> list[Driven]:
    """The same with the motion low-passed."""
    return _segments(model, model.q, model.dq, model.tau_known)


def _segments(model: JointModel, q: Array, dq: Array, known: Array) -> list[Driven]:
    gravity, friction = (model.gravity_sine, model.gravity_cosine), (model.viscous, model.coulomb, model.presliding)
    joint = JointDynamics(model.inertia, (model.constant, *gravity, model.spring, *friction), known)
    first_std = float(np.std(model.tau)) or 1.0
    whole = Driven(joint, q, dq, model.ddq, model.tau, 1.0 / model.rate, first_std)
    return [whole.part(part) for part in segments(model.segment)]
