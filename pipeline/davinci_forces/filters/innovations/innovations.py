"""The innovations of the default filter, each with the deviation that the filter states of it.

S = H P H' + R,    NIS_q = i_q^2 / S_qq,    NIS_dq = i_dq^2 / S_dd ~ chi^2(1), each by itself
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.filters import rts
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.driven import Driven


class Innovations(NamedTuple):
    """Of (N,) samples: position and velocity, and their stated standard deviations."""

    q: Array
    dq: Array
    q_std: Array
    dq_std: Array


def innovations(recording: Driven, noise: NoiseModel) -> Innovations:
    """Those of `ekf`, number for number, from the smoother's pass forwards.  (7.6), (7.7)"""
    (i_q, i_dq, _), predicted = rts.forwards(recording, noise)
    return Innovations(i_q, i_dq, np.sqrt(predicted[:, 3] + noise.r_q**2), np.sqrt(predicted[:, 6] + noise.r_dq**2))
