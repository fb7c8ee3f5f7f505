"""How far behind the filter is: what it would miss of the external effort that the smoother finds, without noise."""

from collections.abc import Sequence

import numpy as np

from pipeline.filters import ekf, rts
from pipeline.filters.problem import NoiseModel
from pipeline.maths.arrays import Array
from pipeline.maths.models.driven import Driven
from pipeline.maths.models.model import JointDynamics


def lag(recordings: Sequence[Driven], noise: NoiseModel) -> Array:
    """The smoothed external effort (N,) of all recordings, less what the filter makes of it.

    The filter sees it as the effort of a joint at rest, where it is linear: position and velocity stay 0.
    """
    return np.concatenate([missed(recording, noise) for recording in recordings])


def missed(recording: Driven, noise: NoiseModel) -> Array:
    """The same of one recording without a gap."""
    smooth = rts.track(recording, noise).tau_ext
    return np.asarray(smooth - ekf.track(pushed(recording, smooth), noise).tau_ext)


def pushed(recording: Driven, tau_ext: Array) -> Driven:
    """A joint that holds still while its motor exerts an effort (N,) on the environment."""
    still = np.zeros(len(tau_ext))
    viscous = recording.joint.coefficients[4]
    joint = JointDynamics(recording.joint.inertia, (0.0, 0.0, 0.0, 0.0, viscous, 0.0, 0.0), still)
    return Driven(joint, still, still, still, tau_ext, recording.T_s, recording.first_std)
