"""The effort by the parameters that a log itself would give, where a fit of other logs does not describe it."""

import numpy as np

from davinci_forces.identification.joint_models import Along
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.records import Fit, JointModel

LEAST = 1e-3  # of the largest singular value: what a log tells less well stays as it was


def refitted(joint: JointModel, fit: Fit, along: Along, free: Booleans) -> Array:
    """tau_hat (N,) of a fit corrected by least squares of what it leaves of a joint's log, over the free samples (N,).

    Phi (theta + D d),    d = arg min |tau - tau_hat - Phi D d|,    D scales each column of Phi to length 1
    """
    model = along.identified.model(fit)
    regressor = model.regressor(along.motion(fit))
    told = free & regressor.known
    Phi = regressor.Phi[:, model.efforts.index(joint.joint)]
    length = np.linalg.norm(Phi[told], axis=0)
    scale = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0)
    d, *_ = np.linalg.lstsq(Phi[told] * scale, (joint.tau - joint.tau_hat)[told], rcond=LEAST)
    return np.asarray(joint.tau_hat + Phi @ (scale * d))
