"""The default filter with coloured measurement noise: two more states.

    x = [q, dq, tau_ext, v_q, v_dq],    y = [q + v_q, dq + v_dq],    v[k+1] = phi v[k] + (1 - phi^2)^0.5 r e[k]

With phi = 0 its innovations are those of `ekf`.  It tests whether coloured noise is the reason why innovations are
not white.  For tracking, white noise needs fewer states and gives the same slow external effort.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.filters import ekf, kalman
from davinci_forces.filters.problem import FilterInput, NoiseModel, Tracked
from davinci_forces.filters.response import MAX_LOG_CHANGE
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.windows import TRANSIENT

MAX_SAMPLES_COLOURED = 2000  # the likelihood is computed on at most this number of samples
TRIALS = 60  # largest number of evaluations of the likelihood per parameter
MAX_ATANH_PHI = 4.0  # for phi = 0.9993
UNCOLOURED = (0.0, 0.0)


class Noise(NamedTuple):
    """The noise of a joint, and the correlation of its measurement noise from sample to sample."""

    white: NoiseModel
    phi: tuple[float, float]  # of position and velocity


def track(recording: FilterInput, noise: Noise) -> Tracked:
    """Filter a recording."""
    [(_, tracked)] = kalman.run_blocks(recording, states(recording, noise))
    return tracked


def log_likelihood(recording: FilterInput, noise: Noise) -> float:
    """Compute the log-likelihood of the measurements, as `ekf` does."""
    transient = min(round(TRANSIENT / recording.T_s), len(recording.q) // 2)
    return kalman.log_likelihood(recording, states(recording, noise), transient)


def states(recording: FilterInput, noise: Noise) -> kalman.States:
    """Return the states of `ekf` and the noise of each measurement, which decays by phi."""
    model = kalman.states(recording, noise.white, 5)
    for i, (r, phi) in enumerate(zip(noise.white[:2], noise.phi, strict=True)):
        v = (3 + i, 3 + i)
        model.P[v], model.Phi[v], model.Q[v] = r**2, phi, (1.0 - phi**2) * r**2
    return model._replace(R=np.zeros(2), in_q=(0, 3), in_dq=(1, 4))


def fit_noise(recording: FilterInput, start: NoiseModel, walks: bool, coloured: bool) -> Noise:
    """Fit the noise of one recording by maximum likelihood: the standard deviations of q, dq and the drive.

    The standard deviation of the random walk is fitted if it `walks` freely, and phi if the noise is `coloured`.
    """
    from scipy.optimize import minimize

    part = recording.part(slice(MAX_SAMPLES_COLOURED))
    names = ("r_q", "r_dq", "q_dq", "q_tau")[: 4 if walks else 3]
    center = np.log([getattr(start, name) for name in names])

    def noise_at(x: Array) -> Noise:
        sizes = dict(zip(names, np.exp(center + x[: len(names)]).tolist(), strict=True))
        return Noise(start._replace(**sizes), tuple(np.tanh(x[len(names) :]).tolist()) if coloured else UNCOLOURED)

    def cost(x: Array) -> float:
        if np.abs(x[: len(names)]).max() > MAX_LOG_CHANGE or np.abs(x[len(names) :]).max(initial=0.0) > MAX_ATANH_PHI:
            return np.inf
        noise = noise_at(x)
        return -(log_likelihood(part, noise) if coloured else ekf.log_likelihood(part, noise.white))

    # The first simplex is wide, because the likelihood may be flat near its start.
    size = len(names) + 2 * coloured
    simplex = np.vstack([np.zeros(size), np.diag([0.5] * len(names) + [1.0] * 2 * coloured)])
    best = minimize(
        cost, np.zeros(size), method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": TRIALS * size, "xatol": 1e-2, "fatol": 0.1},
    )  # fmt: skip
    return noise_at(best.x)
