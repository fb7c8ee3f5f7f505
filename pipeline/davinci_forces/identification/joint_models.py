"""The model of each joint along a log: what a filter is to know of it, and the effort that a fit gives for it."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from davinci_forces.identification.regression import recorded_motion
from davinci_forces.identification.used import Identified
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.models.model import ArmMotion, JointDynamics
from davinci_forces.records import Fit, JointModel, Motion
from davinci_forces.robots.models import ARM

# What a record calls the coefficients of the bias, in their order in `maths.models.bias`.
BIAS = ("constant", "gravity_sine", "gravity_cosine", "spring", "viscous", "coulomb", "presliding")


class Along:
    """What fits say of the joints of one log; what the joints of an arm share is worked out once."""

    def __init__(self, identified: Identified, motions: Iterable[Motion | JointModel]) -> None:
        self.identified, self.motions = identified, {motion.joint: motion for motion in motions}
        self._efforts: dict[tuple[str, ...], Array] = {}
        self._dynamics: dict[tuple[str, ...], tuple[JointDynamics, ...]] = {}

    def held(self, motion: Motion) -> set[str]:
        """The joints that the log holds on the clock of one of them."""
        return {joint for joint, other in self.motions.items() if len(other) == len(motion)}

    def motion(self, fit: Fit) -> ArmMotion:
        """The motion that a fit's model takes, low-passed; the log has to hold its joints."""
        return recorded_motion([self.motions[name] for name in self.identified.model(fit).joints])

    def tau_hat(self, fit: Fit, joint: str) -> Array:
        """The effort (N,) that a fit gives for a joint."""
        model = self.identified.model(fit)
        tau_hat = self._efforts.get(fit.key)
        if tau_hat is None:
            tau_hat = efforts(model, fit.theta, self.motion(fit))
            if fit.group == ARM:
                self._efforts[fit.key] = tau_hat
        return np.ascontiguousarray(tau_hat[:, model.efforts.index(joint)])

    def dynamics(self, fit: Fit, joint: str) -> JointDynamics:
        """What a filter is to know of a joint by a fit.  (7.15), (7.16)"""
        model = self.identified.model(fit)
        dynamics = self._dynamics.get(fit.key) or model.joint_dynamics(fit.theta, self.motion(fit))
        if fit.group == ARM:
            self._dynamics[fit.key] = dynamics
        return dynamics[model.efforts.index(joint)]

    def by(self, fit: Fit, joint: str) -> dict[str, Any]:
        """The fields of a JointModel that follow from a fit."""
        dynamics = self.dynamics(fit, joint)
        return {
            "model": fit.model, "estimator": fit.estimator, "inertia": dynamics.inertia, "tau_known": dynamics.known,
            "tau_hat": self.tau_hat(fit, joint),
            **dict(zip(BIAS, map(float, dynamics.coefficients), strict=True)),
        }  # fmt: skip

    def under(self, model: JointModel, fit: Fit) -> JointModel:
        """A joint under another fit; refits that had not seen it there are none of."""
        unknown: dict[str, Any] = {"scheme": "", "path_unseen": "", "tau_hat_unseen": np.full(len(model), np.nan)}
        return replace(model, **self.by(fit, model.joint), **unknown)
