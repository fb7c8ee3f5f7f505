"""How far behind the filter is: what it would miss of the external effort that the smoother finds, without noise."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.filters import ekf, rts
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import VISCOUS
from davinci_forces.maths.models.driven import Driven, standing


def lag(recordings: Sequence[Driven], noise: NoiseModel) -> tuple[Array, Array]:
    """The smoothed external effort (N,) of all recordings, and that less what the filter makes of it.

    The filter sees it as the effort of a joint at rest, where it is linear: position and velocity stay 0.
    """
    smooth = [rts.track(recording, noise).tau_ext for recording in recordings]
    pushes = (
        standing(part.joint.inertia, part.joint.coefficients[VISCOUS], tau_ext, part.T_s, part.first_std)
        for part, tau_ext in zip(recordings, smooth, strict=True)
    )
    followed = np.concatenate([ekf.track(push, noise).tau_ext for push in pushes])
    return np.concatenate(smooth), np.concatenate(smooth) - followed
