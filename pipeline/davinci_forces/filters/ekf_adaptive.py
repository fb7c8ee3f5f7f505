"""The filter with measurement noise that follows the innovations (Lee and Ahn 2010).

    R = C - H P H',    C the mean of i i' with weights that decay over `WINDOW`

R stays between 0.1 and 1000 times the tuned variance, so that the filter does not lose track of the joint.  Everything
else is as in `ekf`.
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters import kalman
from davinci_forces.filters.problem import Block, NoiseModel, Recording

NAME = "Extended Kalman filter, adaptive noise"
WINDOW = 1.0  # [s] time constant of the mean


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Filter a recording: correct with y_k, then predict with tau_k."""
    forgets = 1.0 - float(np.exp(-recording.T_s / WINDOW))
    model = kalman.states(recording, noise)._replace(forgets=forgets)
    return kalman.run_blocks(recording, model)
