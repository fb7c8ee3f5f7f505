"""The step of the extended Kalman filter compiled, and how recordings and noise enter the compiled passes."""

from collections.abc import Callable
from math import log
from types import FunctionType
from typing import Any

import numpy as np

from davinci_forces.filters import sample
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.filters.sample import first
from davinci_forces.maths.compiled import compile_and_store, compile_function

LOG_2_PI = float(np.log(2.0 * np.pi))
STORED = 15  # numbers that the smoother needs of each sample: its prediction, and the transition to the next sample


def _compile(function: Callable[..., Any], **calls: Any) -> Any:
    """Compile a function with the compiled functions that it calls."""
    assert isinstance(function, FunctionType)
    return compile_function(FunctionType(function.__code__, {**function.__globals__, **calls}, function.__name__))


sign = compile_function(sample.sign)
bias = _compile(sample.bias, sign=sign)
transition = _compile(sample.transition, bias=bias, sign=sign)
gains = compile_function(sample.gains)
correct = _compile(sample.correct, gains=gains)
predict = compile_function(sample.predict)


@compile_and_store
def run(
    out: Any, stored: Any, transient: int, s: Any, y_q: Any, y_dq: Any, drive: Any, inertia: Any, c_b: Any, T_s: float,
    R_q: float, R_dq: float, Q_qq: float, Q_qd: float, Q_dd: float, Q_tau: float,
) -> Any:  # fmt: skip
    """Filter N samples from the belief s: return the next belief, and the log-likelihood from sample `transient` on.

    `out` (7, N) gets the columns of `Tracked`, and `stored` (N, 15) each prediction and the transition to the next
    sample; either may have no samples instead.
    """
    total = 0.0
    for k in range(len(y_q)):
        if k < len(stored):
            for i in range(9):
                stored[k, i] = s[i]
        s, i_q, i_dq, nis, det = correct(s, y_q[k], y_dq[k], R_q, R_dq)
        if k < out.shape[1]:
            out[0, k], out[1, k], out[2, k], out[3, k] = s[0], s[1], s[2], s[8] ** 0.5
            out[4, k], out[5, k], out[6, k] = i_q, i_dq, nis
        if k >= transient:
            total -= 0.5 * (nis + log(det)) + LOG_2_PI
        q, dq, F, friction_var = transition(s[0], s[1], s[2], s[6], drive[k], inertia[k], c_b, T_s, 0.5 * T_s * T_s)
        if k < len(stored):
            for i in range(6):
                stored[k, 9 + i] = F[i]
        s = predict(s, q, dq, F, Q_qq, Q_qd, Q_dd + friction_var, Q_tau)
    return s, total


def arguments(recording: FilterInput, noise: NoiseModel) -> tuple[Any, ...]:
    """Return a recording and its noise as the compiled passes take them."""
    before = first(float(recording.q[0]), float(recording.dq[0]), noise.r_q, noise.r_dq, recording.initial_std)
    return (before, *columns(recording), *covariances(noise, recording.T_s))


def columns(recording: FilterInput) -> tuple[Any, ...]:
    """Return position, velocity, drive and inertia (N,) of a recording, the coefficients of its bias, and T_s."""
    joint = recording.joint
    samples = (recording.q, recording.dq, recording.tau - joint.known, joint.inertia)
    return (*(np.ascontiguousarray(x, float) for x in samples), joint.coefficients, recording.T_s)


def covariances(noise: NoiseModel, T_s: float) -> tuple[float, float, float, float, float, float]:
    """Return R of q and dq, and Q: of q, the covariance of q and dq, of dq, and of the external effort."""
    r_q, r_dq, q_q, q_dq, q_tau = map(float, noise)
    return r_q**2, r_dq**2, q_q**2 + (0.5 * T_s * q_dq) ** 2, 0.5 * T_s * q_dq**2, q_dq**2, q_tau**2
