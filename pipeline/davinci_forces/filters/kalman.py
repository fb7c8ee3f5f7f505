"""A Kalman filter of any number of states, of which position, velocity and external effort are the first three.

    x = [q, dq, tau_ext, ...],    y = H x + v,    v ~ N(0, diag(R_q, R_dq))                                    (7.6)
    x[k+1] = [f(q, dq, tau_ext), Phi x] + w,    w ~ N(0, Q)                                                    (7.7)

f is the step of the joint's motion (`stepping`); the rows of Phi below it are of the effort and of what is added to it.
`ekf` is the same with three states, written out, in two thirds of the time.
"""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.filters import stepping
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.stepping import arguments, transition
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import cached
from davinci_forces.maths.models import bias as derivation
from davinci_forces.maths.models.driven import Driven

LOG_2_PI = float(np.log(2.0 * np.pi))
LEAST, MOST = 0.1, 1e3  # of the variance of a measurement, between which it may follow the innovations


class States(NamedTuple):
    """How n states are measured and move.

    `P` is their covariance before the first sample.  The step of the motion is of first or second `order` in T_s, and
    takes the sign of the velocity as known or `doubts` it.  `forgets` is the share of the innovations' mean square that
    is forgotten over a sample, where R follows it; 0 where R is constant.
    """

    P: Array  # (n, n)
    H: Array  # (2, n)
    Phi: Array  # (n, n)
    Q: Array  # (n, n)
    R: Array  # (2,)
    order: int = 2
    doubts: bool = True
    forgets: float = 0.0


def states(recording: Driven, noise: NoiseModel, n: int = 3) -> States:
    """Those of `ekf`; of the others no noise, and neither what they measure nor what they move."""
    before, *_, R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = arguments(recording, noise)
    P, Q = np.zeros((n, n)), np.zeros((n, n))
    P[[0, 1, 2], [0, 1, 2]] = before[3], before[6], before[8]
    Q[:3, :3] = [[Q_qq, Q_qd, 0.0], [Q_qd, Q_dd, 0.0], [0.0, 0.0, Q_tau]]
    return States(P, np.eye(2, n), np.eye(n), Q, np.array([R_q, R_dq]))


def filtered(recording: Driven, noise: NoiseModel, model: States, settle: int | None = None) -> tuple[Array, float]:
    """q, dq, tau_ext, its deviation, the innovations and NIS of each sample (7, N), and the log-likelihood.

    The likelihood is of the measurements from sample `settle` on; 0 without it.
    """
    before, q, dq, drive, inertia, c_b, T_s, *_ = arguments(recording, noise)
    x, out, N = np.zeros(len(model.P)), np.empty((7, len(q))), len(q)
    x[:2] = before[:2]
    P, H, Phi, Q, R, order, doubts, forgets = model
    h = 0.5 * T_s * T_s * (order - 1)
    total = _pass(
        x, P.copy(), H, Phi.copy(), Q, *R.tolist(), q, dq, drive, inertia, c_b, T_s, h, float(doubts), forgets,
        N if settle is None else settle, out,
    )  # fmt: skip
    return out, float(total)


@cached(derivation, stepping)
def _pass(
    x: Any, P: Any, H: Any, F: Any, Q: Any, R_q: float, R_dq: float, y_q: Any, y_dq: Any, drive: Any, inertia: Any,
    c_b: Any, T_s: float, h: float, doubts: float, forgets: float, settle: int, out: Any,
) -> float:  # fmt: skip
    """The loop.  P = P - K B' - (B - K S) K' with B = P H' is the Joseph form, positive for any gain."""
    n, first_q, first_dq, C_q, C_dq, total = len(x), R_q, R_dq, 0.0, 0.0, 0.0
    B, D, K, N = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, n))
    for k in range(len(y_q)):
        i_q, i_dq, s_qq, s_qd, s_dd = y_q[k], y_dq[k], 0.0, 0.0, 0.0
        for i in range(n):
            B[i, 0], B[i, 1] = 0.0, 0.0
            for j in range(n):
                B[i, 0] += P[i, j] * H[0, j]
                B[i, 1] += P[i, j] * H[1, j]
            i_q, i_dq = i_q - H[0, i] * x[i], i_dq - H[1, i] * x[i]
            s_qq, s_qd, s_dd = s_qq + H[0, i] * B[i, 0], s_qd + H[0, i] * B[i, 1], s_dd + H[1, i] * B[i, 1]
        if forgets > 0.0 and k > 0:
            if k == 1:  # the first prediction knows the velocity
                C_q, C_dq = s_qq + R_q, s_dd + R_dq
            C_q, C_dq = C_q + forgets * (i_q * i_q - C_q), C_dq + forgets * (i_dq * i_dq - C_dq)
            R_q = min(max(C_q - s_qq, LEAST * first_q), MOST * first_q)
            R_dq = min(max(C_dq - s_dd, LEAST * first_dq), MOST * first_dq)
        s_qq, s_dd = s_qq + R_q, s_dd + R_dq
        det = s_qq * s_dd - s_qd * s_qd
        v_qq, v_qd, v_dd = s_dd / det, -s_qd / det, s_qq / det
        nis = i_q * (v_qq * i_q + v_qd * i_dq) + i_dq * (v_qd * i_q + v_dd * i_dq)
        if k >= settle:
            total -= 0.5 * (nis + np.log(det)) + LOG_2_PI
        for i in range(n):
            K[i, 0], K[i, 1] = B[i, 0] * v_qq + B[i, 1] * v_qd, B[i, 0] * v_qd + B[i, 1] * v_dd
            D[i, 0] = B[i, 0] - K[i, 0] * s_qq - K[i, 1] * s_qd
            D[i, 1] = B[i, 1] - K[i, 0] * s_qd - K[i, 1] * s_dd
            x[i] += K[i, 0] * i_q + K[i, 1] * i_dq
            for j in range(i + 1):
                P[i, j] -= K[i, 0] * B[j, 0] + K[i, 1] * B[j, 1] + D[i, 0] * K[j, 0] + D[i, 1] * K[j, 1]
                P[j, i] = P[i, j]
        out[0, k], out[1, k], out[2, k], out[3, k] = x[0], x[1], x[2], P[2, 2] ** 0.5
        out[4, k], out[5, k], out[6, k] = i_q, i_dq, nis
        q, dq, top, unsure = transition(x[0], x[1], x[2], doubts * P[1, 1], drive[k], inertia[k], c_b, T_s, h)
        for j in range(3):
            F[0, j], F[1, j] = top[j], top[3 + j]
        for i in range(3, n):  # the effort's own rate moves the velocity, to second order
            F[1, i] = h / T_s * (-1.0 / inertia[k]) * F[2, i]
            dq += F[1, i] * x[i]
        x[0], x[1] = q, dq
        for i in range(n):
            first = i if i > 1 else 0  # no state below the motion is moved by one before it
            if first:
                x[i] *= F[i, i]
                for j in range(i + 1, n):
                    x[i] += F[i, j] * x[j]
            for j in range(n):
                p = 0.0
                for m in range(first, n):
                    p += F[i, m] * P[m, j]
                N[i, j] = p
        for i in range(n):
            first = i if i > 1 else 0
            for j in range(i + 1):
                p = Q[i, j]
                for m in range(first, n):
                    p += F[i, m] * N[j, m]
                P[i, j], P[j, i] = p, p
        P[1, 1] += unsure
    return total
