"""The default filter with measurement noise that has a memory: two more states.

    x = [q, dq, tau_ext, v_q, v_dq],    y = [q + v_q, dq + v_dq],    v[k+1] = phi v[k] + (1 - phi^2)^0.5 r e[k]

Without memory, phi = 0, its innovations are those of `ekf`.  It serves to tell whether coloured noise is why these are
not white; for tracking, the noise that is white has fewer states and says the same of what is slow.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.filters import ekf, kalman
from davinci_forces.filters.problem import Driven, NoiseModel
from davinci_forces.maths.arrays import Array
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
    _, _, _, _, i_q, i_dq, _ = kalman.filtered(recording, states(recording, noise))
    return i_q, i_dq


def log_likelihood(recording: Driven, noise: Noise) -> float:
    """Of the measurements, as that of `ekf`."""
    settle = min(round(SETTLE / recording.T_s), len(recording.q) // 2)
    return kalman.log_likelihood(recording, states(recording, noise), settle)


def states(recording: Driven, noise: Noise) -> kalman.States:
    """Those of `ekf` and the noise of each measurement, which is measured with it and forgotten by phi."""
    model = kalman.states(recording, noise.white, 5)
    for i, (r, phi) in enumerate(zip(noise.white[:2], noise.phi, strict=True)):
        v = (3 + i, 3 + i)
        model.P[v], model.Phi[v], model.Q[v] = r**2, phi, (1.0 - phi**2) * r**2
    return model._replace(R=np.zeros(2), in_q=(0, 3), in_dq=(1, 4))


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
