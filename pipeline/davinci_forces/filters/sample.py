"""One sample of the extended Kalman filter, in plain Python: `stepping` compiles it, and exports copy it.

The second-order step of a joint's motion:

    f(x, u) = [dq, (u - b(q, dq) - tau_ext) / M, 0],    A = df/dx
    x[k+1] = x + T_s f + T_s^2 / 2 A f + w,    F = I + T_s A + T_s^2 / 2 A^2          (7.11)-(7.16), stepped further

Where the velocity passes through 0, the sign of Coulomb friction is uncertain.  The friction's mean is then
c_f erf(dq / sqrt(2 P_dq)), and its variance c_f^2 (1 - erf^2) is added to the noise of the drive.

A filter corrects its belief of one joint by a measurement, and predicts it for the next sample.

    x = [q, dq, tau_ext],    y = [q, dq] + v,    v ~ N(0, diag(r_q^2, r_dq^2))                      (7.6), (7.11)-(7.16)

A belief is x and the upper half of P, as nine numbers.  This file needs Python alone, from 3.10 on.
"""

import math
from typing import Any

TINY = 1e-300
COULOMB = 5  # the index of its coefficient in the bias
# Initial variance of position and velocity over that of a measurement: with this ratio the initial state has no weight
# against measurements.  A larger ratio would leave the smoother without digits.
INITIAL_VARIANCE_RATIO = 1e6


def bias(c: Any, q: float, dq: float, z: float) -> Any:
    """b and its derivatives by q and dq, as in `maths.models.terms`, with the sine of the system's C library."""
    sine, cosine = math.sin(q), math.cos(q)
    b = c[0] + c[1] * sine + c[2] * cosine + c[3] * q + c[4] * dq + c[5] * sign(dq) + c[6] * z
    return b, c[1] * cosine - c[2] * sine + c[3], c[4]


def sign(x: float) -> float:
    """-1, 0 or 1."""
    return 1.0 if x > 0.0 else -1.0 if x < 0.0 else 0.0


def transition(
    q: float, dq: float, tau_ext: float, dq_var: float, drive: float, M: float, c_b: Any, T_s: float, h: float
) -> Any:
    """Step position and velocity by a sample; return both, F, and the velocity variance by an uncertain friction sign.

    h is T_s^2 / 2; with 0 the step is forward Euler's.
    """
    b, b_q, b_dq = bias(c_b, q, dq, 0.0)
    sure = math.erf(dq / math.sqrt(2.0 * dq_var + TINY))
    b += c_b[COULOMB] * (sure - sign(dq))
    doubt = T_s * c_b[COULOMB] / M
    friction_var = doubt * doubt * (1.0 - sure * sure)
    a_q, a_dq, a_tau = -b_q / M, -b_dq / M, -1.0 / M
    ddq, of_dq = (drive - b - tau_ext) / M, T_s + h * a_dq
    F = (1.0 + h * a_q, of_dq, h * a_tau, of_dq * a_q, 1.0 + of_dq * a_dq + h * a_q, of_dq * a_tau)
    return q + T_s * dq + h * ddq, dq + T_s * ddq + h * (a_q * dq + a_dq * ddq), F, friction_var


Belief = tuple[float, float, float, float, float, float, float, float, float]


def first(q: float, dq: float, r_q: float, r_dq: float, initial_std: float) -> Belief:
    """Return the initial belief, at the first position and velocity instead of the printed x = 0, P = Q_0.  (7.6)"""
    q_var, dq_var = INITIAL_VARIANCE_RATIO * r_q * r_q, INITIAL_VARIANCE_RATIO * r_dq * r_dq
    return q, dq, 0.0, q_var, 0.0, 0.0, dq_var, 0.0, initial_std * initial_std


def gains(s: Any, R_q: float, R_dq: float) -> Any:
    """Compute S^-1 (3 numbers), K = P H' S^-1 (6, row by row), and det S."""
    _, _, _, a, b, c, d, e, _ = s
    s_qq, s_dd = a + R_q, d + R_dq
    det = s_qq * s_dd - b * b
    v_qq, v_qd, v_dd = s_dd / det, -b / det, s_qq / det
    return (
        v_qq, v_qd, v_dd,
        a * v_qq + b * v_qd, a * v_qd + b * v_dd,
        b * v_qq + d * v_qd, b * v_qd + d * v_dd,
        c * v_qq + e * v_qd, c * v_qd + e * v_dd,
        det,
    )  # fmt: skip


def correct(s: Any, y_q: float, y_dq: float, R_q: float, R_dq: float) -> Any:
    """Correct a belief by a measurement; return the belief, the innovations, their normalised square and det S.  (7.6)

    Joseph form: P = (I - K H) P (I - K H)' + K R K', symmetric and positive for any gain.
    """
    x_q, x_dq, x_tau, a, b, c, d, e, f = s
    v_qq, v_qd, v_dd, k11, k12, k21, k22, k31, k32, det = gains(s, R_q, R_dq)
    i_q, i_dq = y_q - x_q, y_dq - x_dq
    nis = i_q * (v_qq * i_q + v_qd * i_dq) + i_dq * (v_qd * i_q + v_dd * i_dq)
    m11, m12, m21, m22 = 1.0 - k11, -k12, -k21, 1.0 - k22
    p11, p12, p13 = m11 * a + m12 * b, m11 * b + m12 * d, m11 * c + m12 * e
    p21, p22, p23 = m21 * a + m22 * b, m21 * b + m22 * d, m21 * c + m22 * e
    p31, p32, p33 = c - k31 * a - k32 * b, e - k31 * b - k32 * d, f - k31 * c - k32 * e
    after = (
        x_q + k11 * i_q + k12 * i_dq,
        x_dq + k21 * i_q + k22 * i_dq,
        x_tau + k31 * i_q + k32 * i_dq,
        p11 * m11 + p12 * m12 + k11 * R_q * k11 + k12 * R_dq * k12,
        p11 * m21 + p12 * m22 + k11 * R_q * k21 + k12 * R_dq * k22,
        p13 - p11 * k31 - p12 * k32 + k11 * R_q * k31 + k12 * R_dq * k32,
        p21 * m21 + p22 * m22 + k21 * R_q * k21 + k22 * R_dq * k22,
        p23 - p21 * k31 - p22 * k32 + k21 * R_q * k31 + k22 * R_dq * k32,
        p33 - p31 * k31 - p32 * k32 + k31 * R_q * k31 + k32 * R_dq * k32,
    )
    return after, i_q, i_dq, nis, det


def predict(s: Any, q: float, dq: float, F: Any, Q_qq: float, Q_qd: float, Q_dd: float, Q_tau: float) -> Any:
    """Predict the belief at the next sample, of position q and velocity dq: P is F P F' + Q.  (7.7)"""
    _, _, tau_ext, a, b, c, d, e, f = s
    f11, f12, f13, f21, f22, f23 = F
    n11, n12, n13 = f11 * a + f12 * b + f13 * c, f11 * b + f12 * d + f13 * e, f11 * c + f12 * e + f13 * f
    n21, n22, n23 = f21 * a + f22 * b + f23 * c, f21 * b + f22 * d + f23 * e, f21 * c + f22 * e + f23 * f
    return (
        q,
        dq,
        tau_ext,
        n11 * f11 + n12 * f12 + n13 * f13 + Q_qq,
        n21 * f11 + n22 * f12 + n23 * f13 + Q_qd,
        n13,
        n21 * f21 + n22 * f22 + n23 * f23 + Q_dd,
        n23,
        f + Q_tau,
    )
