"""The extended Kalman filter as the source prints it, with forward Euler steps.

    q[k+1]       = q + T_s dq + w_q
    dq[k+1]      = dq + T_s (tau - b(q, dq) - tau_ext) / M + w_dq
    tau_ext[k+1] = tau_ext + w_tau                                                        (7.11)-(7.16)

The errors of a step in position and velocity are added to the process noise, by their mean squares over the recording.
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters import kalman
from davinci_forces.filters.problem import Block, NoiseModel, Recording, column

NAME = "Extended Kalman filter, forward Euler"


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Filter a recording: correct with y_k, then predict with tau_k.  (7.6), (7.7)"""
    T_s, ddq = recording.T_s, column(recording, lambda part: part.ddq)
    jerk = np.gradient(ddq, T_s) if len(ddq) > 1 else np.zeros(1)
    step_q_var, step_dq_var = (0.25 * T_s**4 * float(np.mean(x**2)) for x in (ddq, jerk))
    model = kalman.states(recording, noise)._replace(order=1, doubts=False)
    model.Q[:2, :2] = np.diag([noise.q_q**2 + step_q_var, noise.q_dq**2 + step_dq_var])
    return kalman.run_blocks(recording, model)
