"""The effort by the parameters that a log itself would give, where a fit of other logs does not describe it."""

import numpy as np

from davinci_forces.identification.driving import Driving, Motions
from davinci_forces.identification.regression import of_joints
from davinci_forces.identification.used import model_of
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.robots.robot import Robot

LEAST = 1e-3  # of the largest singular value: what a log tells less well stays as it was


def refitted(own: Driving, motions: Motions, robot: Robot, free: Booleans) -> Array:
    """tau_hat (N,) of a fit corrected by least squares of what it leaves of a joint's log, over the free samples (N,).

    Phi (theta + D d),    d = arg min |tau - tau_hat - Phi D d|,    D scales each column of Phi to length 1
    """
    model = model_of(robot, own.fit)
    regressor = model.regressor(of_joints([motions[name] for name in model.joints]))
    told = free & regressor.known
    Phi = regressor.Phi[:, model.efforts.index(own.signal.joint)]
    length = np.linalg.norm(Phi[told], axis=0)
    scale = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0)
    d, *_ = np.linalg.lstsq(Phi[told] * scale, (own.signal.tau - own.tau_hat)[told], rcond=LEAST)
    return np.asarray(own.tau_hat + Phi @ (scale * d))
