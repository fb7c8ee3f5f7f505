"""The filter with measurement noise that follows the innovations (Lee and Ahn 2010).

    R = C - H P H',    C the mean of i i' over the last second or so, each sample counting less the older it is

never less than a tenth of the variance that was tuned, nor more than a thousand times that, lest it let go of the
joint.  All else is as in `ekf`.
"""

import numpy as np

from davinci_forces.filters import kalman
from davinci_forces.filters.problem import Driven, NoiseModel, Tracked

NAME = "The same, adaptive noise"
WINDOW = 1.0  # [s] over which innovations are forgotten


def track(recording: Driven, noise: NoiseModel) -> Tracked:
    """Filter a recording: correct with y_k, then predict with tau_k."""
    forgets = 1.0 - float(np.exp(-recording.T_s / WINDOW))
    model = kalman.states(recording, noise)._replace(forgets=forgets)
    return Tracked(*kalman.filtered(recording, model))
