"""Chart the friction of every joint over its velocity: what the rest of the model leaves of the effort.  Fig 6.21"""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.identification.regression import recorded_motion
from davinci_forces.identification.used import Identified
from davinci_forces.maths.signals.noise import smoothed
from davinci_forces.maths.signals.velocity_map import over_velocity
from davinci_forces.records import Fit, FrictionMap, Motion
from davinci_forces.robots.robot import Robot

ROLES = ("identification", "friction")
BY = ("lse", "ridge")  # estimators whose fits are charted: the plain ones


def run(motion: Motion, fits: Iterable[Fit], robot: Robot, *, lowpass: float) -> Iterator[FrictionMap]:
    """One FrictionMap per log that tells of friction, joint and model of the joint by itself.

    Of a coupled arm the rest of the effort depends on other joints, which a log of one does not hold.
    """
    if motion.role not in ROLES or motion.at_rest:
        return
    identified = Identified(robot, fits)
    for fit in identified.describing(motion.joint):
        if fit.estimator in BY and fit.model.startswith("independent"):
            yield charted(motion, fit, identified, lowpass)


def charted(motion: Motion, fit: Fit, identified: Identified, lowpass: float) -> FrictionMap:
    """tau - Phi_other theta_other, and Phi_friction theta_friction, as means over ranges of velocity."""
    Phi, known = identified.model(fit).regressor(recorded_motion([motion]))
    friction = np.array(["friction" in str(name) for name in fit.parameter])
    left = smoothed(motion.tau, motion.segment, motion.rate, lowpass) - Phi[:, 0] @ np.where(friction, 0.0, fit.theta)
    modelled = Phi[:, 0] @ np.where(friction, fit.theta, 0.0)
    dq, ddq = motion.dq[known], motion.ddq[known]
    found = over_velocity(dq, ddq, np.column_stack([left, modelled])[known])
    return FrictionMap(
        log=motion.log,
        joint=motion.joint,
        model=fit.model,
        estimator=fit.estimator,
        role=motion.role,
        dq=found.dq,
        gaining=found.gaining.astype(int),
        tau_friction=found.mean[:, 0],
        tau_friction_std=found.std[:, 0],
        tau_friction_hat=found.mean[:, 1],
    )
