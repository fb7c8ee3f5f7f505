"""The measured effort less that of the model, sample by sample, at the measured motion q, dq and ddq.

tau_ext = tau - M ddq - b(q, dq)                                                  (7.28)
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters.problem import Block, FilterInput, NoiseModel, Recording, Tracked, input_blocks
from davinci_forces.maths.models.bias import bias

NAME = "Measured minus model"


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Subtract block by block."""
    return ((rows, track(part, noise)) for rows, part in input_blocks(recording))


def track(recording: FilterInput, noise: NoiseModel) -> Tracked:
    """Subtract the model's effort; the standard deviation is that of the noise of the effort."""
    joint, q, dq, ddq, tau, T_s, _ = recording
    tau_ext = tau - joint.inertia * ddq - bias(joint.coefficients, q, dq, 0.0)[0] - joint.known
    zeros = np.zeros(len(q))
    return Tracked(q, dq, tau_ext, joint.inertia * noise.q_dq / T_s, zeros, zeros, zeros)
