"""The extended Kalman filter of one joint, with the external effort as a state.

x = [q, dq, tau_ext],        y = [q, dq] + v,        v ~ N(0, diag(r_q^2, r_dq^2))

q[k+1]       = q + T_s dq + w_q
dq[k+1]      = dq + T_s (tau - b(q, dq) - tau_ext) / M + w_dq
tau_ext[k+1] = tau_ext + w_tau                                                        (7.11)-(7.16)
"""

from typing import Any

import numpy as np

from pipeline.filters.problem import NoiseModel, Tracked
from pipeline.maths.arrays import Array
from pipeline.maths.compiled import cached
from pipeline.maths.models import bias as derivation
from pipeline.maths.models.kernels import bias
from pipeline.maths.models.model import JointDynamics

# The first prediction knows nothing: 10^3 times as uncertain as the measurement noise, and a broad external effort.
FIRST = 1e3


def track(
    joint: JointDynamics, q: Array, dq: Array, tau: Array, T_s: float, noise: NoiseModel, first_std: float
) -> Tracked:
    """Filter a recording: correct with y_k, then predict with tau_k.  (7.6), (7.7)

    `q`, `dq`, `tau` are (N,) in the joint's units, `T_s` [s]; `first_std` is the standard deviation of the external
    effort before the first sample, when the state is taken as 0.
    """
    out = np.empty((7, len(q)))
    q, dq, drive, inertia = (np.ascontiguousarray(x, float) for x in (q, dq, tau - joint.known, joint.inertia))
    _pass(joint.coefficients, inertia, q, dq, drive, T_s, *noise, first_std, FIRST, *out)
    return Tracked(*out)


@cached(derivation)
def _pass(
    c_b: Any, inertia: Any, y_q: Any, y_dq: Any, drive: Any, T_s: float, r_q: float, r_dq: float, q_q: float,
    q_dq: float, q_tau: float, first_std: float, first: float, out_q: Any, out_dq: Any, out_tau: Any, out_std: Any,
    out_iq: Any, out_idq: Any, out_nis: Any,
) -> None:  # fmt: skip
    """The loop.  P is symmetric: a b c / b d e / c e f for the states q, dq, tau_ext."""
    R_q, R_dq, Q_q, Q_dq, Q_tau = r_q * r_q, r_dq * r_dq, q_q * q_q, q_dq * q_dq, q_tau * q_tau
    x_q, x_dq, x_tau = 0.0, 0.0, 0.0
    # Not the printed x = 0, P = Q_0 alone: Q_0 must be broad for the first sample to set the position and velocity.
    a, b, c, d, e, f = 1.0 + first * R_q, 0.0, 0.0, 1.0 + first * R_dq, 0.0, first_std * first_std
    for k in range(len(y_q)):
        i_q, i_dq = y_q[k] - x_q, y_dq[k] - x_dq
        s_qq, s_qd, s_dd = a + R_q, b, d + R_dq
        det = s_qq * s_dd - s_qd * s_qd
        v_qq, v_qd, v_dd = s_dd / det, -s_qd / det, s_qq / det
        nis = i_q * (v_qq * i_q + v_qd * i_dq) + i_dq * (v_qd * i_q + v_dd * i_dq)
        # K = P H' S^-1
        k11, k12 = a * v_qq + b * v_qd, a * v_qd + b * v_dd
        k21, k22 = b * v_qq + d * v_qd, b * v_qd + d * v_dd
        k31, k32 = c * v_qq + e * v_qd, c * v_qd + e * v_dd
        x_q += k11 * i_q + k12 * i_dq
        x_dq += k21 * i_q + k22 * i_dq
        x_tau += k31 * i_q + k32 * i_dq
        # Joseph form, (I - K H) P (I - K H)' + K R K', symmetric and positive for any gain.
        m11, m12, m21, m22 = 1.0 - k11, -k12, -k21, 1.0 - k22
        p11, p12, p13 = m11 * a + m12 * b, m11 * b + m12 * d, m11 * c + m12 * e
        p21, p22, p23 = m21 * a + m22 * b, m21 * b + m22 * d, m21 * c + m22 * e
        p31, p32, p33 = c - k31 * a - k32 * b, e - k31 * b - k32 * d, f - k31 * c - k32 * e
        a = p11 * m11 + p12 * m12 + k11 * R_q * k11 + k12 * R_dq * k12
        b = p11 * m21 + p12 * m22 + k11 * R_q * k21 + k12 * R_dq * k22
        d = p21 * m21 + p22 * m22 + k21 * R_q * k21 + k22 * R_dq * k22
        c = p13 - p11 * k31 - p12 * k32 + k11 * R_q * k31 + k12 * R_dq * k32
        e = p23 - p21 * k31 - p22 * k32 + k21 * R_q * k31 + k22 * R_dq * k32
        f = p33 - p31 * k31 - p32 * k32 + k31 * R_q * k31 + k32 * R_dq * k32
        out_q[k], out_dq[k], out_tau[k], out_std[k] = x_q, x_dq, x_tau, f**0.5
        out_iq[k], out_idq[k], out_nis[k] = i_q, i_dq, nis
        # x = f(x, u), P = F P F' + Q with F = [1 T 0; g h l; 0 0 1]
        bias_k, bias_q, bias_dq = bias(c_b, x_q, x_dq, 0.0)
        M = inertia[k]
        g, h, l = -T_s * bias_q / M, 1.0 - T_s * bias_dq / M, -T_s / M  # noqa: E741
        x_q, x_dq = x_q + T_s * x_dq, x_dq + T_s * (drive[k] - bias_k - x_tau) / M
        n11, n12, n13 = a + T_s * b, b + T_s * d, c + T_s * e
        n21, n22, n23 = g * a + h * b + l * c, g * b + h * d + l * e, g * c + h * e + l * f
        a = n11 + T_s * n12 + Q_q
        b = g * n11 + h * n12 + l * n13
        d = g * n21 + h * n22 + l * n23 + Q_dq
        c, e, f = n13, n23, f + Q_tau
