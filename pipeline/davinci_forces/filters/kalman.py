"""A Kalman filter of any number of states, of which position, velocity and external effort are the first three.

    x = [q, dq, tau_ext, ...],    y = H x + v,    v ~ N(0, diag(R))                                              (7.6)
    x[k+1] = [f(q, dq, tau_ext), Phi x] + w,    w ~ N(0, Q)                                                      (7.7)

f is the step of the joint's motion (`stepping`).  `ekf` is the same filter for three states; its written-out equations
take three quarters of the time.
"""

from collections.abc import Callable, Iterator
from functools import partial
from math import log
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.filters.problem import Block, FilterInput, NoiseModel, Recording, Tracked, input_blocks
from davinci_forces.filters.sample import INITIAL_VARIANCE_RATIO
from davinci_forces.filters.stepping import LOG_2_PI, columns, covariances, transition
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_and_store

MIN_STATES = 5  # of a short recording's loop, for which the compiler takes longer than for the zeros among them
MIN_SAMPLES_OWN_LOOP = 1_000_000  # from this on a loop of only the model's states is compiled, as it takes 0.6 the time
MIN_NOISE_RATIO, MAX_NOISE_RATIO = 0.1, 1e3  # range of an adapted measurement variance, relative to the tuned one


class States(NamedTuple):
    """n initial states, their measurement model, and their motion from one sample to the next.

    `Phi` is upper triangular; the filter computes the rows of position and velocity.
    """

    x: tuple[float, ...]  # (n,)
    P: Array  # (n, n) their covariance
    R: Array  # (2,) variances of the measurements
    Phi: Array  # (n, n)
    Q: Array  # (n, n)
    in_q: tuple[int, ...] = (0,)  # the states whose sum is measured as position
    in_dq: tuple[int, ...] = (1,)  # the states whose sum is measured as velocity
    order: int = 2  # of the motion's step in T_s: 1 or 2
    doubts: bool = True  # whether the sign of Coulomb friction is uncertain near zero velocity
    forgets: float = 0.0  # share of the innovations' mean square forgotten per sample, if R adapts; 0: R is fixed


def states(recording: Recording, noise: NoiseModel, n: int = 3) -> States:
    """Return the states of `ekf`, and n - 3 further states that are 0, constant and not measured."""
    R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = covariances(noise, recording.T_s)
    first = recording.part(slice(0, 1))
    x, others = (float(first.q[0]), float(first.dq[0]), 0.0), [0.0] * (n - 3)
    P = np.diag([INITIAL_VARIANCE_RATIO * R_q, INITIAL_VARIANCE_RATIO * R_dq, recording.initial_std**2, *others])
    Q = np.diag([Q_qq, Q_dd, Q_tau, *others])
    Q[0, 1] = Q[1, 0] = Q_qd
    return States((*x, *others), P, np.array([R_q, R_dq]), np.eye(n), Q)


def run_blocks(recording: Recording, model: States) -> Iterator[Block]:
    """Compute the columns of `Tracked` block by block: correct with y_k, then predict with tau_k.  (7.6), (7.7)"""
    run = _loop(model, recording)
    for rows, part in input_blocks(recording):
        out = np.empty((7, part.samples))
        run(rows.start, recording.samples, out, *columns(part))
        yield rows, Tracked(*out)


def log_likelihood(recording: FilterInput, model: States, transient: int) -> float:
    """Compute the log-likelihood from sample `transient` on: -1/2 sum of (i' S^-1 i + log det 2 pi S)."""
    return float(_loop(model, recording)(0, transient, np.empty((7, recording.samples)), *columns(recording)))


def _loop(model: States, recording: Recording) -> Callable[..., Any]:
    """Return the loop for consecutive blocks of a recording; it keeps the state after each.

    Short recordings get further states of zeros, so that all filters share one compiled loop.
    """
    x, P, R, Phi, Q, in_q, in_dq, order, doubts, forgets = model
    zeros = max(MIN_STATES - len(x), 0) if recording.samples < MIN_SAMPLES_OWN_LOOP else 0
    if zeros:
        P, Phi, Q = (np.pad(A, (0, zeros)) for A in (P, Phi, Q))
        in_q, in_dq = (*in_q, len(x))[:2], (*in_dq, len(x))[:2]
    x, (R_q, R_dq), h = (*x, *[0.0] * zeros), R.tolist(), 0.5 * recording.T_s**2 * (order - 1)
    adapted = np.array([R_q, R_dq, 0.0, 0.0])
    return partial(_pass, x, np.array(x), P.copy(), adapted, in_q, in_dq, R_q, R_dq, Phi, Q, h, float(doubts), forgets)


@compile_and_store
def _pass(
    start: Any, state: Any, P: Any, adapted: Any, in_q: Any, in_dq: Any, tuned_q: float, tuned_dq: float, F: Any,
    Q: Any, h: float, doubts: float, forgets: float, before: int, transient: int, out: Any, y_q: Any, y_dq: Any,
    drive: Any, inertia: Any, c_b: Any, T_s: float,
) -> float:  # fmt: skip
    """Run the loop over a block after `before` samples; `state`, P and `adapted` change.

    `adapted` is the variances of the measurements and the mean squares of the innovations.  `start` is a tuple of the
    length n of `state`, so that the compiler knows n, which is twice as fast.
    """
    n, R_q, R_dq, C_q, C_dq, total = len(start), adapted[0], adapted[1], adapted[2], adapted[3], 0.0
    x, B, D, K, G = state.copy(), np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, n))
    for k in range(len(y_q)):
        i_q, i_dq, s_qq, s_qd, s_dd = y_q[k], y_dq[k], 0.0, 0.0, 0.0
        for i in range(n):  # B = P H'
            b_q, b_dq = 0.0, 0.0
            for j in in_q:
                b_q += P[i, j]
            for j in in_dq:
                b_dq += P[i, j]
            B[i, 0], B[i, 1] = b_q, b_dq
        for i in in_q:
            i_q, s_qq, s_qd = i_q - x[i], s_qq + B[i, 0], s_qd + B[i, 1]
        for i in in_dq:
            i_dq, s_dd = i_dq - x[i], s_dd + B[i, 1]
        if forgets > 0.0 and before + k > 0:
            if before + k == 1:  # the first sample has set the velocity
                C_q, C_dq = s_qq + R_q, s_dd + R_dq
            C_q, C_dq = C_q + forgets * (i_q * i_q - C_q), C_dq + forgets * (i_dq * i_dq - C_dq)
            R_q = min(max(C_q - s_qq, MIN_NOISE_RATIO * tuned_q), MAX_NOISE_RATIO * tuned_q)
            R_dq = min(max(C_dq - s_dd, MIN_NOISE_RATIO * tuned_dq), MAX_NOISE_RATIO * tuned_dq)
        s_qq, s_dd = s_qq + R_q, s_dd + R_dq
        det = s_qq * s_dd - s_qd * s_qd
        v_qq, v_qd, v_dd = s_dd / det, -s_qd / det, s_qq / det
        nis = i_q * (v_qq * i_q + v_qd * i_dq) + i_dq * (v_qd * i_q + v_dd * i_dq)
        if before + k >= transient:
            total -= 0.5 * (nis + log(det)) + LOG_2_PI
        # Joseph form, positive for any gain: P - K B' - D K' with D = B - K S
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
        dq_var = doubts * P[1, 1]
        x[0], x[1], top, friction_var = transition(x[0], x[1], x[2], dq_var, drive[k], inertia[k], c_b, T_s, h)
        for j in range(3):
            F[0, j], F[1, j] = top[j], top[3 + j]
        for i in range(3, n):  # a change of the effort changes the velocity, to second order
            F[1, i] = -h / T_s / inertia[k] * F[2, i]
            x[1] += F[1, i] * x[i]
        for i in range(n):
            first = i if i > 1 else 0
            if first:
                x[i] *= F[i, i]
                for j in range(i + 1, n):
                    x[i] += F[i, j] * x[j]
            for j in range(n):  # G = F P
                g = 0.0
                for m in range(first, n):
                    g += F[i, m] * P[m, j]
                G[i, j] = g
        for i in range(n):
            first = i if i > 1 else 0
            for j in range(i + 1):
                p = Q[i, j]
                for m in range(first, n):
                    p += F[i, m] * G[j, m]
                P[i, j], P[j, i] = p, p
        P[1, 1] += friction_var
    adapted[0], adapted[1], adapted[2], adapted[3] = R_q, R_dq, C_q, C_dq
    for i in range(n):  # a slice would bring the compiler's functions for texts of errors
        state[i] = x[i]
    return total
