"""The extended Kalman filter of one joint, with the external effort as a state, with the second-order step of `sample`.

Forward Euler, as the source prints it (`ekf_euler`), omits T_s^2 / 2 times the acceleration.  This term exceeds an
encoder's noise.  The process noise of the velocity is that of an acceleration that is constant over a sample.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from davinci_forces.filters.problem import Block, FilterInput, NoiseModel, Recording, Tracked, input_blocks
from davinci_forces.filters.sample import Belief
from davinci_forces.filters.stepping import STORED, arguments, correct, covariances, predict, run, transition
from davinci_forces.maths.compiled import compile_and_store
from davinci_forces.maths.models.terms import Coefficients
from davinci_forces.maths.signals.windows import TRANSIENT

NAME = "Extended Kalman filter"


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Filter a recording: correct with y_k, then predict with tau_k.  (7.6), (7.7)"""
    s: Any = None
    for rows, part in input_blocks(recording):
        out = np.empty((7, part.samples))
        before, *others = arguments(part, noise)
        s, _ = run(out, np.empty((0, STORED)), part.samples, s or before, *others)
        yield rows, Tracked(*out)


def log_likelihood(recording: FilterInput, noise: NoiseModel) -> float:
    """Compute the log-likelihood of the measurements (2 N): -1/2 sum of (i' S^-1 i + log det 2 pi S).

    The first second is omitted, because it still depends on the initial state.
    """
    transient = min(round(TRANSIENT / recording.T_s), len(recording.q) // 2)
    return float(run(np.empty((7, 0)), np.empty((0, STORED)), transient, *arguments(recording, noise))[1])


def step(
    s: Belief, y: tuple[float, float], drive: float, M: float, c_b: Coefficients, T_s: float, noise: NoiseModel
) -> tuple[Belief, Belief]:
    """Filter one sample as it arrives: return the corrected state, and its prediction for the next sample.

    `s` is the last prediction, or `sample.first`; `y` are position and velocity; `drive` is the effort less the known
    effort of other joints.  The results equal those of `blocks` exactly for the same drive and inertia M.
    """
    corrected, predicted = _step(s, *y, drive, M, c_b, T_s, *covariances(noise, T_s))
    return corrected, predicted


@compile_and_store
def _step(
    s: Any, y_q: float, y_dq: float, drive: float, M: float, c_b: Any, T_s: float, R_q: float, R_dq: float,
    Q_qq: float, Q_qd: float, Q_dd: float, Q_tau: float,
) -> Any:  # fmt: skip
    now, _, _, _, _ = correct(s, y_q, y_dq, R_q, R_dq)
    q, dq, F, friction_var = transition(now[0], now[1], now[2], now[6], drive, M, c_b, T_s, 0.5 * T_s * T_s)
    return now, predict(now, q, dq, F, Q_qq, Q_qd, Q_dd + friction_var, Q_tau)
