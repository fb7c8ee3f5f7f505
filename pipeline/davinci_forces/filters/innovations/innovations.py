"""The innovations of the default filter, each with the deviation that the filter states of it.

S = H P H' + R,    NIS_q = i_q^2 / S_qq,    NIS_dq = i_dq^2 / S_dd ~ chi^2(1), each by itself
"""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.filters import belief, stepping
from davinci_forces.filters.belief import corrected, spread
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.stepping import arguments, transition
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import cached
from davinci_forces.maths.models import bias as derivation
from davinci_forces.maths.models.driven import Driven


class Innovations(NamedTuple):
    """Of (N,) samples: position and velocity, and their stated standard deviations."""

    q: Array
    dq: Array
    q_std: Array
    dq_std: Array


def innovations(recording: Driven, noise: NoiseModel) -> Innovations:
    """Those of `ekf`, number for number.  (7.6), (7.7)"""
    out = np.empty((4, len(recording.q)))
    _pass(*arguments(recording, noise), *out)
    return Innovations(*out)


@cached(derivation, belief, stepping)
def _pass(
    s: Any, y_q: Any, y_dq: Any, drive: Any, inertia: Any, c_b: Any, T_s: float, R_q: float, R_dq: float, Q_qq: float,
    Q_qd: float, Q_dd: float, Q_tau: float, out_q: Any, out_dq: Any, out_q_std: Any, out_dq_std: Any,
) -> None:  # fmt: skip
    """The loop."""
    for k in range(len(y_q)):
        out_q_std[k], out_dq_std[k] = (s[3] + R_q) ** 0.5, (s[6] + R_dq) ** 0.5
        s, out_q[k], out_dq[k], _, _ = corrected(s, y_q[k], y_dq[k], R_q, R_dq)
        q, dq, F, unsure = transition(s[0], s[1], s[2], s[6], drive[k], inertia[k], c_b, T_s)
        s = spread(s, q, dq, F, Q_qq, Q_qd, Q_dd + unsure, Q_tau)
