"""The default filter with measurement noise that has a memory: two more states.

    x = [q, dq, tau_ext, v_q, v_dq],    y = [q + v_q, dq + v_dq],    v[k+1] = phi v[k] + (1 - phi^2)^0.5 r e[k]

Without memory, phi = 0, its innovations are those of `ekf`.  It serves to tell whether coloured noise is why these are
not white; for tracking, the noise that is white has fewer states and says the same of what is slow.
"""

from typing import Any, NamedTuple

import numpy as np

from davinci_forces.filters import ekf, stepping
from davinci_forces.filters.ekf import LOG_2_PI
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.stepping import arguments, transition
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import cached
from davinci_forces.maths.models import bias as derivation
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.signals.windows import SETTLE

MOST = 2000  # samples that the likelihood is of
TRIALS = 60  # of the likelihood, a parameter
FARTHEST = np.log(1e3)  # that a deviation may be taken from where it starts
SLOWEST = 4.0  # atanh of the largest phi, .9993
UNCOLOURED = (0.0, 0.0)


class Noise(NamedTuple):
    """What is assumed of a joint: deviations, and the correlation of the measurement noise from sample to sample."""

    white: NoiseModel
    phi: tuple[float, float]  # of position and velocity


def innovations(recording: Driven, noise: Noise) -> tuple[Array, Array]:
    """Of position and velocity (N,)."""
    out = np.empty((2, len(recording.q)))
    _pass(0, *noise.phi, *arguments(recording, noise.white), *out)
    return out[0], out[1]


def log_likelihood(recording: Driven, noise: Noise) -> float:
    """Of the measurements, as that of `ekf`."""
    settle = min(round(SETTLE / recording.T_s), len(recording.q) // 2)
    out = np.empty((2, len(recording.q)))
    return float(_pass(settle, *noise.phi, *arguments(recording, noise.white), *out))


def likeliest(recording: Driven, start: NoiseModel, walks: bool, coloured: bool) -> Noise:
    """The noise of the greatest likelihood of one recording: the deviations of q, dq and of the drive, that of the
    walk where it `walks` freely, and phi where it is `coloured`.
    """
    from scipy.optimize import minimize

    some = recording.part(slice(MOST))
    names = ("r_q", "r_dq", "q_dq", "q_tau")[: 4 if walks else 3]
    known = np.log([getattr(start, name) for name in names])

    def noise_at(x: Array) -> Noise:
        sizes = dict(zip(names, np.exp(known + x[: len(names)]).tolist(), strict=True))
        return Noise(start._replace(**sizes), tuple(np.tanh(x[len(names) :]).tolist()) if coloured else UNCOLOURED)

    def unlikely(x: Array) -> float:
        if np.abs(x[: len(names)]).max() > FARTHEST or (coloured and np.abs(x[len(names) :]).max() > SLOWEST):
            return np.inf
        noise = noise_at(x)
        return -(log_likelihood(some, noise) if coloured else ekf.log_likelihood(some, noise.white))

    # Starting points at a distance: the likelihood of one alone may be flat.
    size = len(names) + 2 * coloured
    simplex = np.vstack([np.zeros(size), np.diag([0.5] * len(names) + [1.0] * 2 * coloured)])
    found = minimize(
        unlikely, np.zeros(size), method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": TRIALS * size, "xatol": 1e-2, "fatol": 0.1},
    )  # fmt: skip
    return noise_at(found.x)


@cached(derivation, stepping)
def _pass(
    settle: int, phi_q: float, phi_dq: float, s: Any, y_q: Any, y_dq: Any, drive: Any, inertia: Any, c_b: Any,
    T_s: float, R_q: float, R_dq: float, Q_qq: float, Q_qd: float, Q_dd: float, Q_tau: float, out_q: Any, out_dq: Any,
) -> float:  # fmt: skip
    """The loop, with matrices of 5 by 5; the log-likelihood after `settle` samples."""
    x, P, F, B, K, total = np.zeros(5), np.zeros((5, 5)), np.zeros((5, 5)), np.zeros((5, 5)), np.zeros((5, 2)), 0.0
    x[0], x[1], P[0, 0], P[1, 1], P[2, 2], P[3, 3], P[4, 4] = s[0], s[1], s[3], s[6], s[8], R_q, R_dq
    F[2, 2], F[3, 3], F[4, 4] = 1.0, phi_q, phi_dq
    for k in range(len(y_q)):
        i_q, i_dq = y_q[k] - x[0] - x[3], y_dq[k] - x[1] - x[4]
        out_q[k], out_dq[k] = i_q, i_dq
        s_qq = P[0, 0] + 2.0 * P[0, 3] + P[3, 3]
        s_qd = P[0, 1] + P[0, 4] + P[3, 1] + P[3, 4]
        s_dd = P[1, 1] + 2.0 * P[1, 4] + P[4, 4]
        det = s_qq * s_dd - s_qd * s_qd
        if k >= settle:
            nis = (i_q * i_q * s_dd - 2.0 * i_q * i_dq * s_qd + i_dq * i_dq * s_qq) / det
            total -= 0.5 * (nis + np.log(det)) + LOG_2_PI
        for i in range(5):
            g, h = P[i, 0] + P[i, 3], P[i, 1] + P[i, 4]
            K[i, 0], K[i, 1] = (g * s_dd - h * s_qd) / det, (h * s_qq - g * s_qd) / det
            B[i, 0], B[i, 1] = g, h
        for i in range(5):
            x[i] += K[i, 0] * i_q + K[i, 1] * i_dq
            for j in range(5):
                P[i, j] -= K[i, 0] * B[j, 0] + K[i, 1] * B[j, 1]
        q, dq, top, unsure = transition(x[0], x[1], x[2], P[1, 1], drive[k], inertia[k], c_b, T_s)
        x[0], x[1], x[3], x[4] = q, dq, phi_q * x[3], phi_dq * x[4]
        for j in range(3):
            F[0, j], F[1, j] = top[j], top[3 + j]
        for i in range(5):
            for j in range(5):
                B[i, j] = 0.0
                for m in range(5):
                    B[i, j] += F[i, m] * P[m, j]
        for i in range(5):
            for j in range(i, 5):
                p = 0.0
                for m in range(5):
                    p += B[i, m] * F[j, m]
                P[i, j], P[j, i] = p, p
        P[0, 0], P[0, 1], P[1, 0] = P[0, 0] + Q_qq, P[0, 1] + Q_qd, P[1, 0] + Q_qd
        P[1, 1], P[2, 2] = P[1, 1] + Q_dd + unsure, P[2, 2] + Q_tau
        P[3, 3], P[4, 4] = P[3, 3] + (1.0 - phi_q * phi_q) * R_q, P[4, 4] + (1.0 - phi_dq * phi_dq) * R_dq
    return total
