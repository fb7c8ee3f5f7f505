"""What a filter is given: one joint's recording without a gap, and what is known of the joint."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import COEFFICIENTS, VISCOUS
from davinci_forces.maths.models.model import JointDynamics


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
