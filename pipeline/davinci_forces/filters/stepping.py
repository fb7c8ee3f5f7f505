"""The second-order step of a joint's motion, and how recordings and noise enter the compiled passes.

    f(x, u) = [dq, (u - b(q, dq) - tau_ext) / M, 0],    A = df/dx
    x[k+1] = x + T_s f + T_s^2 / 2 A f + w,    F = I + T_s A + T_s^2 / 2 A^2          (7.11)-(7.16), stepped further

Where the velocity passes through 0, nobody knows the sign of Coulomb friction: it is c_f erf(dq / sqrt(2 P_dq)) on
average, and c_f^2 (1 - erf^2) about that, which counts as noise of the drive.
"""

import math
from typing import Any

import numpy as np

from davinci_forces.filters import belief
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.maths.compiled import compiled
from davinci_forces.maths.models.bias import COULOMB
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.models.kernels import bias

TINY = 1e-300


def arguments(recording: Driven, noise: NoiseModel) -> tuple[Any, ...]:
    """A recording and its noise as the compiled passes take them."""
    before = belief.first(float(recording.q[0]), float(recording.dq[0]), noise.r_q, noise.r_dq, recording.first_std)
    return (before, *columns(recording), *covariances(noise, recording.T_s))


def columns(recording: Driven) -> tuple[Any, ...]:
    """Position, velocity, drive and inertia (N,) of a recording, the coefficients of its bias, and T_s."""
    joint = recording.joint
    samples = (recording.q, recording.dq, recording.tau - joint.known, joint.inertia)
    return (*(np.ascontiguousarray(x, float) for x in samples), joint.coefficients, recording.T_s)


def covariances(noise: NoiseModel, T_s: float) -> tuple[float, float, float, float, float, float]:
    """R of q and dq, and Q: of q, of q and dq together, of dq, and of the external effort."""
    r_q, r_dq, q_q, q_dq, q_tau = map(float, noise)
    return r_q**2, r_dq**2, q_q**2 + (0.5 * T_s * q_dq) ** 2, 0.5 * T_s * q_dq**2, q_dq**2, q_tau**2


@compiled
def transition(
    q: float, dq: float, tau_ext: float, dq_var: float, drive: float, M: float, c_b: Any, T_s: float, h: float
) -> Any:
    """Position and velocity one sample later, F, and the variance that a doubtful sign adds to the velocity.

    h is T_s^2 / 2; with 0 it is forward Euler's step.
    """
    b, b_q, b_dq = bias(c_b, q, dq, 0.0)
    likely = math.erf(dq / math.sqrt(2.0 * dq_var + TINY))
    b += c_b[COULOMB] * (likely - np.sign(dq))
    unsure = (T_s * c_b[COULOMB] / M) ** 2 * (1.0 - likely * likely)
    a_q, a_dq, a_tau = -b_q / M, -b_dq / M, -1.0 / M
    ddq, of_dq = (drive - b - tau_ext) / M, T_s + h * a_dq
    F = (1.0 + h * a_q, of_dq, h * a_tau, of_dq * a_q, 1.0 + of_dq * a_dq + h * a_q, of_dq * a_tau)
    return q + T_s * dq + h * ddq, dq + T_s * ddq + h * (a_q * dq + a_dq * ddq), F, unsure
