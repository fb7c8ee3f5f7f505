"""The measured effort less that of the model, sample by sample, at the measured motion q, dq and ddq.

tau_ext = tau - M ddq - b(q, dq)                                                  (7.28)
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters.problem import Block, NoiseModel, Recording, Tracked, input_blocks
from davinci_forces.maths.models.terms import bias

NAME = "Measured minus model"


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Subtract the model's effort; the standard deviation is that of the noise of the effort."""
    for rows, (joint, q, dq, ddq, tau, T_s, _) in input_blocks(recording):
        tau_ext = tau - joint.inertia * ddq - bias(joint.coefficients, q, dq, 0.0)[0] - joint.known
        zeros = np.zeros(len(q))
        yield rows, Tracked(q, dq, tau_ext, joint.inertia * noise.q_dq / T_s, zeros, zeros, zeros)
