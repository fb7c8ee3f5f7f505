"""The extended Kalman filter as it is printed: forward Euler.

    q[k+1]       = q + T_s dq + w_q
    dq[k+1]      = dq + T_s (tau - b(q, dq) - tau_ext) / M + w_dq
    tau_ext[k+1] = tau_ext + w_tau                                                        (7.11)-(7.16)

What a step leaves out of position and velocity is process noise, by the root mean square of the recording.
"""

from typing import Any

import numpy as np

from davinci_forces.filters import belief
from davinci_forces.filters.belief import corrected, spread
from davinci_forces.filters.problem import NoiseModel, Tracked
from davinci_forces.filters.stepping import arguments
from davinci_forces.maths.compiled import cached
from davinci_forces.maths.models import bias as derivation
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.models.kernels import bias


def track(recording: Driven, noise: NoiseModel) -> Tracked:
    """Filter a recording: correct with y_k, then predict with tau_k.  (7.6), (7.7)"""
    out, T_s = np.empty((7, len(recording.q))), recording.T_s
    motion = arguments(recording, noise)[:7]
    jerk = np.gradient(recording.ddq, T_s) if len(recording.q) > 1 else np.zeros(1)
    left_q, left_dq = (0.25 * T_s**4 * float(np.mean(x**2)) for x in (recording.ddq, jerk))
    Q = (noise.q_q**2 + left_q, noise.q_dq**2 + left_dq, noise.q_tau**2)
    _pass(*(*motion, noise.r_q**2, noise.r_dq**2, *Q), *out)
    return Tracked(*out)


@cached(derivation, belief)
def _pass(
    s: Any, y_q: Any, y_dq: Any, drive: Any, inertia: Any, c_b: Any, T_s: float, R_q: float, R_dq: float, Q_qq: float,
    Q_dd: float, Q_tau: float, out_q: Any, out_dq: Any, out_tau: Any, out_std: Any, out_iq: Any, out_idq: Any,
    out_nis: Any,
) -> None:  # fmt: skip
    for k in range(len(y_q)):
        s, i_q, i_dq, nis, _ = corrected(s, y_q[k], y_dq[k], R_q, R_dq)
        out_q[k], out_dq[k], out_tau[k], out_std[k] = s[0], s[1], s[2], s[8] ** 0.5
        out_iq[k], out_idq[k], out_nis[k] = i_q, i_dq, nis
        M = inertia[k]
        b, b_q, b_dq = bias(c_b, s[0], s[1], 0.0)
        F = (1.0, T_s, 0.0, -T_s * b_q / M, 1.0 - T_s * b_dq / M, -T_s / M)
        dq = s[1] + T_s * (drive[k] - b - s[2]) / M
        s = spread(s, s[0] + T_s * s[1], dq, F, Q_qq, 0.0, Q_dd, Q_tau)
