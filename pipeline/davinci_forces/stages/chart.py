"""Chart the friction of every joint over its velocity: what the rest of the model leaves of the effort.  Fig 6.21"""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.identification.regression import measured_motion
from davinci_forces.identification.used import describing, model_of
from davinci_forces.maths.signals.noise import smoothed
from davinci_forces.maths.signals.velocity_map import over_velocity
from davinci_forces.records import Fit, FrictionMap, Signal
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

ROLES = ("identification", "friction")
BY = ("lse", "ridge")  # estimators whose fits are charted: the plain ones


def run(signal: Signal, fits: Iterable[Fit], entry: LogEntry, robot: Robot, *, lowpass: float) -> Iterator[FrictionMap]:
    """One FrictionMap per log that tells of friction, joint and model of the joint by itself.

    Of a coupled arm the rest of the effort depends on other joints, which a log of one does not hold.
    """
    if entry.role not in ROLES or signal.at_rest:
        return
    for fit in describing(robot, fits, signal.joint):
        if fit.estimator in BY and fit.model.startswith("independent"):
            yield charted(signal, fit, robot, lowpass)


def charted(signal: Signal, fit: Fit, robot: Robot, lowpass: float) -> FrictionMap:
    """tau - Phi_other theta_other, and Phi_friction theta_friction, as means over ranges of velocity."""
    motion = measured_motion(signal, lowpass)
    Phi, known = model_of(robot, fit).regressor(motion)
    friction = np.array(["friction" in str(name) for name in fit.parameter])
    left = smoothed(signal.tau, signal.segment, signal.rate, lowpass) - Phi[:, 0] @ np.where(friction, 0.0, fit.theta)
    modelled = Phi[:, 0] @ np.where(friction, fit.theta, 0.0)
    dq, ddq = motion.dq[known, 0], motion.ddq[known, 0]
    found = over_velocity(dq, ddq, np.column_stack([left, modelled])[known])
    return FrictionMap(
        log=signal.log,
        joint=signal.joint,
        model=fit.model,
        estimator=fit.estimator,
        role=signal.role,
        dq=found.dq,
        gaining=found.gaining.astype(int),
        tau_friction=found.mean[:, 0],
        tau_friction_std=found.std[:, 0],
        tau_friction_hat=found.mean[:, 1],
    )
