"""How far behind the filter is: what it would miss of the external effort that the smoother finds, without noise."""

from collections.abc import Sequence

import numpy as np

from pipeline.filters import ekf, rts
from pipeline.filters.problem import NoiseModel
from pipeline.maths.arrays import Array
from pipeline.maths.models.driven import Driven
from pipeline.maths.models.model import JointDynamics


def lag(recordings: Sequence[Driven], noise: NoiseModel) -> tuple[Array, Array]:
    """The smoothed external effort (N,) of all recordings, and that less what the filter makes of it.

    The filter sees it as the effort of a joint at rest, where it is linear: position and velocity stay 0.
    """
    smooth = [rts.track(recording, noise).tau_ext for recording in recordings]
    followed = [ekf.track(pushed(part, x), noise).tau_ext for part, x in zip(recordings, smooth, strict=True)]
    return np.concatenate(smooth), np.concatenate(smooth) - np.concatenate(followed)


def pushed(recording: Driven, tau_ext: Array) -> Driven:
    """A joint that holds still while its motor exerts an effort (N,) on the environment."""
    still = np.zeros(len(tau_ext))
    viscous = recording.joint.coefficients[4]
    joint = JointDynamics(recording.joint.inertia, (0.0, 0.0, 0.0, 0.0, viscous, 0.0, 0.0), still)
    return Driven(joint, still, still, still, tau_ext, recording.T_s, recording.first_std)
