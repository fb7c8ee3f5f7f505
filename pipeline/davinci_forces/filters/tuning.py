"""Tune the noise of a joint's filter on recordings in which nothing touches the robot.

The noise of position, velocity and drive maximises the likelihood of the innovations (section 7.3).  The random walk of
the external effort is the smallest one that follows a push.  Without external effort the likeliest walk would be 0, and
the filter would then not follow any external effort.
"""

from collections.abc import Sequence

import numpy as np

from davinci_forces.filters import DEFAULT, ekf, tracker
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.filters.response import smallest_q_tau
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import PUSH_DELAY

ROUNDS = 4  # number of rounds that fit the likelihood and the push in turn
MAX_LOG_CHANGE = np.log(1e3)  # largest change of a standard deviation's logarithm from the start of the search
MAX_SAMPLES_TUNING = 20_000  # at most this number of each recording's samples is used


def tune_noise(
    recordings: Sequence[FilterInput], start: NoiseModel, inertia: float, viscous: float, delay: float = PUSH_DELAY
) -> NoiseModel:
    """Tune the noise of a joint to all recordings together, from `start`, an estimate without the filter.

    `inertia` is the largest along the recordings: with the largest inertia the filter is slowest.
    The filter shows a push within `delay` [s].
    """
    from scipy.optimize import minimize

    T_s = recordings[0].T_s
    parts = [recording.part(slice(MAX_SAMPLES_TUNING)) for recording in recordings]
    noise, center = start, np.log([start.r_q, start.r_dq, start.q_dq])
    change = np.zeros(len(center))
    for _ in range(ROUNDS):
        noise = noise._replace(q_tau=smallest_q_tau(tracker(DEFAULT), inertia, viscous, T_s, noise, delay))
        walk = noise.q_tau

        def cost(change: Array, walk: float = walk) -> float:
            if np.abs(change).max() > MAX_LOG_CHANGE:
                return np.inf
            return -sum(ekf.log_likelihood(part, noise_of(center + change, walk)) for part in parts)

        # The first simplex is wide, because the likelihood may be flat near its start.
        simplex = change + np.vstack([np.zeros(3), 0.5 * np.eye(3)])
        change = minimize(
            cost, change, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-2}
        ).x
        noise = noise_of(center + change, walk)
    return noise._replace(q_tau=smallest_q_tau(tracker(DEFAULT), inertia, viscous, T_s, noise, delay))


def noise_of(logarithms: Array, q_tau: float) -> NoiseModel:
    """Return the noise from the logarithms of its standard deviations r_q, r_dq and q_dq."""
    r_q, r_dq, q_dq = np.exp(logarithms).tolist()
    return NoiseModel(r_q, r_dq, 0.0, q_dq, q_tau)


def likeliest_walk(recordings: Sequence[FilterInput], noise: NoiseModel) -> float:
    """Find the `q_tau` of greatest likelihood, for recordings with external effort, as in section 7.3."""
    from scipy.optimize import minimize_scalar

    def cost(logarithm: float) -> float:
        walk = noise._replace(q_tau=float(np.exp(logarithm)))
        return -sum(ekf.log_likelihood(part, walk) for part in recordings)

    start = np.log(noise.q_tau or float(np.std(recordings[0].tau)) * recordings[0].T_s)
    best = minimize_scalar(cost, bounds=(start - MAX_LOG_CHANGE, start + MAX_LOG_CHANGE), method="bounded")
    return float(np.exp(best.x))
