"""The filter with measurement noise that follows the innovations (Lee and Ahn 2010).

    R = C - H P H',    C the mean of i i' over the last second or so, each sample counting less the older it is

never less than a tenth of the variance that was tuned, nor more than a thousand times that, lest it let go of the
joint.  All else is as in `ekf`.
"""

from typing import Any

import numpy as np

from davinci_forces.filters import belief, stepping
from davinci_forces.filters.belief import corrected, spread
from davinci_forces.filters.problem import NoiseModel, Tracked
from davinci_forces.filters.stepping import arguments, transition
from davinci_forces.maths.compiled import cached
from davinci_forces.maths.models import bias as derivation
from davinci_forces.maths.models.driven import Driven

WINDOW = 1.0  # [s] over which innovations are forgotten
LEAST, MOST = 0.1, 1e3  # of the variance that was tuned


def track(recording: Driven, noise: NoiseModel) -> Tracked:
    """Filter a recording: correct with y_k, then predict with tau_k."""
    out = np.empty((7, len(recording.q)))
    _pass(float(np.exp(-recording.T_s / WINDOW)), *arguments(recording, noise), *out)
    return Tracked(*out)


@cached(derivation, belief, stepping)
def _pass(
    keeps: float, s: Any, y_q: Any, y_dq: Any, drive: Any, inertia: Any, c_b: Any, T_s: float, R_q: float, R_dq: float,
    Q_qq: float, Q_qd: float, Q_dd: float, Q_tau: float, out_q: Any, out_dq: Any, out_tau: Any, out_std: Any,
    out_iq: Any, out_idq: Any, out_nis: Any,
) -> None:  # fmt: skip
    tuned_q, tuned_dq, C_q, C_dq = R_q, R_dq, 0.0, 0.0
    for k in range(len(y_q)):
        of_q, of_dq = s[3], s[6]
        i_q, i_dq = y_q[k] - s[0], y_dq[k] - s[1]
        if k == 1:  # the first prediction knows the velocity
            C_q, C_dq = of_q + R_q, of_dq + R_dq
        if k > 0:
            C_q, C_dq = keeps * C_q + (1.0 - keeps) * i_q * i_q, keeps * C_dq + (1.0 - keeps) * i_dq * i_dq
            R_q = min(max(C_q - of_q, LEAST * tuned_q), MOST * tuned_q)
            R_dq = min(max(C_dq - of_dq, LEAST * tuned_dq), MOST * tuned_dq)
        s, i_q, i_dq, nis, _ = corrected(s, y_q[k], y_dq[k], R_q, R_dq)
        out_q[k], out_dq[k], out_tau[k], out_std[k] = s[0], s[1], s[2], s[8] ** 0.5
        out_iq[k], out_idq[k], out_nis[k] = i_q, i_dq, nis
        q, dq, F, unsure = transition(s[0], s[1], s[2], s[6], drive[k], inertia[k], c_b, T_s)
        s = spread(s, q, dq, F, Q_qq, Q_qd, Q_dd + unsure, Q_tau)
