"""The input and the output of every filter."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import COEFFICIENTS, VISCOUS
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import JointModel


class FilterInput(NamedTuple):
    """A recording as a filter takes it: (N,) samples in the joint's units; T_s [s].

    `ddq` has no delay; `initial_std` is the standard deviation of the external effort before the first sample.
    """

    joint: JointDynamics
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    T_s: float
    initial_std: float

    def part(self, which: slice) -> "FilterInput":
        """Return some of the samples, in their order."""
        joint = self.joint._replace(inertia=self.joint.inertia[which], known=self.joint.known[which])
        q, dq, ddq, tau = (x[which] for x in (self.q, self.dq, self.ddq, self.tau))
        return FilterInput(joint, q, dq, ddq, tau, self.T_s, self.initial_std)


def stationary_joint(inertia: Array, viscous: float, tau: Array, T_s: float, initial_std: float) -> FilterInput:
    """Return a joint at rest whose motor exerts an effort (N,) on the environment; a filter is linear there."""
    still = np.zeros(len(tau))
    coefficients = tuple(viscous if i == VISCOUS else 0.0 for i in range(len(COEFFICIENTS)))
    return FilterInput(JointDynamics(inertia, coefficients, still), still, still, still, tau, T_s, initial_std)  # type: ignore[arg-type]


class NoiseModel(NamedTuple):
    """Standard deviations of the measurements, and of the process noise of each state over a sample."""

    r_q: float
    r_dq: float
    q_q: float
    q_dq: float  # due to an acceleration that is constant over the sample and changes q by T_s q_dq / 2
    q_tau: float  # of one step of the random walk


class Tracked(NamedTuple):
    """The states of a filter over (N,) samples, their uncertainty, and the normalised innovation squared (NIS).

    A filter without innovations returns 0 for them and for `nis`.
    """

    q: Array
    dq: Array
    tau_ext: Array
    tau_ext_std: Array
    innovation_q: Array
    innovation_dq: Array
    nis: Array


Filter = Callable[[FilterInput, NoiseModel], Tracked]  # track(recording, noise)


def filter_inputs(model: JointModel, tau_hat: Array | None = None) -> list[FilterInput]:
    """Return the segments of a joint's log for a filter, as measured; a filter restarts after each gap.

    `tau_hat` (N,) is the effort of another fit, to be subtracted instead of the model's effort.
    """
    tau_known = model.tau_known if tau_hat is None else model.tau_known + (tau_hat - model.tau_hat)
    return _segments(model, model.q_measured, model.dq_measured, tau_known)


def smooth_filter_inputs(model: JointModel) -> list[FilterInput]:
    """Return the segments of a joint's log for a filter, with the motion low-passed."""
    return _segments(model, model.q, model.dq, model.tau_known)


def _segments(model: JointModel, q: Array, dq: Array, tau_known: Array) -> list[FilterInput]:
    gravity, friction = (model.gravity_sine, model.gravity_cosine), (model.viscous, model.coulomb, model.presliding)
    joint = JointDynamics(model.inertia, (model.constant, *gravity, model.spring, *friction), tau_known)
    initial_std = float(np.std(model.tau)) or 1.0
    whole = FilterInput(joint, q, dq, model.ddq, model.tau, 1.0 / model.rate, initial_std)
    return [whole.part(part) for part in segments(model.segment)]
