"""A Kalman filter with the external effort and its rate as states: the rate walks, so that a ramp is followed.

    d/dt tau_ext = rate,    rate[k+1] = rate[k] + w,    w ~ N(0, q_tau^2 / T_s^2)

All else is as in `ekf`, stepped to second order.  `q_tau` is what the rate gains over a sample, times the sample.
"""

from typing import Any

import numpy as np

from davinci_forces.filters.belief import FIRST
from davinci_forces.filters.problem import NoiseModel, Tracked
from davinci_forces.filters.stepping import covariances
from davinci_forces.maths.compiled import cached
from davinci_forces.maths.models import bias as derivation
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.models.kernels import bias

STATES = 4


def track(recording: Driven, noise: NoiseModel) -> Tracked:
    """Filter a recording: correct with y_k, then predict with tau_k."""
    joint, q, dq, _, tau, T_s, first_std = recording
    R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = covariances(noise, T_s)
    walk = Q_tau / T_s**2
    Q = np.zeros((STATES, STATES))
    Q[:2, :2] = [[Q_qq, Q_qd], [Q_qd, Q_dd]]
    Q[2:, 2:] = walk * np.array([[T_s**2 / 3.0, T_s / 2.0], [T_s / 2.0, 1.0]])
    P = np.diag([FIRST * R_q, FIRST * R_dq, first_std**2, first_std**2])
    out = np.empty((7, len(q)))
    y_q, y_dq, drive, inertia = (np.ascontiguousarray(x, float) for x in (q, dq, tau - joint.known, joint.inertia))
    _pass(y_q, y_dq, drive, inertia, joint.coefficients, T_s, R_q, R_dq, Q, P, *out)
    return Tracked(*out)


@cached(derivation)
def _pass(
    y_q: Any, y_dq: Any, drive: Any, inertia: Any, c_b: Any, T_s: float, R_q: float, R_dq: float, Q: Any, P: Any,
    out_q: Any, out_dq: Any, out_tau: Any, out_std: Any, out_iq: Any, out_idq: Any, out_nis: Any,
) -> None:  # fmt: skip
    n, h = STATES, 0.5 * T_s * T_s
    x, K, F, G = np.array([y_q[0], y_dq[0], 0.0, 0.0]), np.zeros((n, 2)), np.eye(n), np.zeros((n, n))
    for k in range(len(y_q)):
        i_q, i_dq = y_q[k] - x[0], y_dq[k] - x[1]
        s_qq, s_qd, s_dd = P[0, 0] + R_q, P[0, 1], P[1, 1] + R_dq
        det = s_qq * s_dd - s_qd * s_qd
        v_qq, v_qd, v_dd = s_dd / det, -s_qd / det, s_qq / det
        for i in range(n):
            K[i, 0], K[i, 1] = P[i, 0] * v_qq + P[i, 1] * v_qd, P[i, 0] * v_qd + P[i, 1] * v_dd
            x[i] += K[i, 0] * i_q + K[i, 1] * i_dq
        # Joseph form: G = (I - K H) P, then P = G (I - K H)' + K R K'
        for i in range(n):
            for j in range(n):
                G[i, j] = P[i, j] - K[i, 0] * P[0, j] - K[i, 1] * P[1, j]
        for i in range(n):
            for j in range(n):
                P[i, j] = (
                    G[i, j] - G[i, 0] * K[j, 0] - G[i, 1] * K[j, 1] + K[i, 0] * R_q * K[j, 0] + K[i, 1] * R_dq * K[j, 1]
                )
        out_q[k], out_dq[k], out_tau[k], out_std[k] = x[0], x[1], x[2], P[2, 2] ** 0.5
        out_iq[k], out_idq[k] = i_q, i_dq
        out_nis[k] = i_q * (v_qq * i_q + v_qd * i_dq) + i_dq * (v_qd * i_q + v_dd * i_dq)
        # F = I + T_s A + T_s^2/2 A^2, with A = [0 1 0 0; a_q a_dq a_tau 0; 0 0 0 1; 0 0 0 0]
        M = inertia[k]
        b, b_q, b_dq = bias(c_b, x[0], x[1], 0.0)
        a_q, a_dq, a_tau = -b_q / M, -b_dq / M, -1.0 / M
        ddq, of_dq = (drive[k] - b - x[2]) / M, T_s + h * a_dq
        F[0, 0], F[0, 1], F[0, 2], F[0, 3] = 1.0 + h * a_q, of_dq, h * a_tau, 0.0
        F[1, 0], F[1, 1], F[1, 2], F[1, 3] = of_dq * a_q, 1.0 + of_dq * a_dq + h * a_q, of_dq * a_tau, h * a_tau
        F[2, 3] = T_s
        q, dq = x[0] + T_s * x[1] + h * ddq, x[1] + T_s * ddq + h * (a_q * x[1] + a_dq * ddq + a_tau * x[3])
        x[0], x[1], x[2] = q, dq, x[2] + T_s * x[3]
        for i in range(n):
            for j in range(n):
                G[i, j] = 0.0
                for m in range(n):
                    G[i, j] += F[i, m] * P[m, j]
        for i in range(n):
            for j in range(n):
                P[i, j] = Q[i, j]
                for m in range(n):
                    P[i, j] += G[i, m] * F[j, m]
