"""A Kalman filter with the external effort and its rate as states: the rate walks, so that the filter follows a ramp.

    d/dt tau_ext = rate,    rate[k+1] = rate[k] + w,    w ~ N(0, q_tau^2 / T_s^2)

The step of the motion is that of `ekf`, but the sign of the velocity is taken as known.  `q_tau` is the standard
deviation of the rate's change over a sample, times T_s.
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters import kalman
from davinci_forces.filters.problem import Block, NoiseModel, Recording

NAME = "Kalman filter, effort and its rate"


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Filter a recording: correct with y_k, then predict with tau_k."""
    T_s = recording.T_s
    model = kalman.states(recording, noise, 4)._replace(doubts=False)
    model.P[3, 3] = recording.initial_std**2
    model.Phi[2, 3] = T_s
    model.Q[2:, 2:] = noise.q_tau**2 / T_s**2 * np.array([[T_s**2 / 3.0, T_s / 2.0], [T_s / 2.0, 1.0]])
    return kalman.run_blocks(recording, model)
