"""The noise that the filter assumes of a joint, from recordings in which nothing touches it.

The noise of position, velocity and drive is that of the greatest likelihood of the innovations (section 7.3); how much
the external effort may walk is the least that shows a push, because where there is no effort the likelihood wants a
filter that is deaf.
"""

from collections.abc import Sequence

import numpy as np

from davinci_forces.filters import ekf
from davinci_forces.filters.problem import Driven, NoiseModel
from davinci_forces.filters.response import slowest
from davinci_forces.maths.arrays import Array

ROUNDS = 4  # of likelihood and push in turn
FARTHEST = np.log(1e3)  # that the likelihood may take a deviation from where it starts
MOST = 20_000  # samples of each recording that the likelihood is of


def tuned(recordings: Sequence[Driven], start: NoiseModel, inertia: float, viscous: float) -> NoiseModel:
    """The noise of a joint, all recordings taken together; `start` is what is known of it without the filter.

    `inertia` is the largest along the recordings: with it the filter is slowest.
    """
    from scipy.optimize import minimize

    T_s = recordings[0].T_s
    some = [recording.part(slice(MOST)) for recording in recordings]
    noise, known = start, np.log([start.r_q, start.r_dq, start.q_dq])
    away = np.zeros(len(known))
    for _ in range(ROUNDS):
        noise = noise._replace(q_tau=slowest(ekf.track, inertia, viscous, T_s, noise))
        walk = noise.q_tau

        def unlikely(away: Array, walk: float = walk) -> float:
            if np.abs(away).max() > FARTHEST:
                return np.inf
            return -sum(ekf.log_likelihood(part, of(known + away, walk)) for part in some)

        # Starting points at a distance: the likelihood of one alone may be flat.
        simplex = away + np.vstack([np.zeros(3), 0.5 * np.eye(3)])
        away = minimize(
            unlikely, away, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-2}
        ).x
        noise = of(known + away, walk)
    return noise._replace(q_tau=slowest(ekf.track, inertia, viscous, T_s, noise))


def of(logarithms: Array, q_tau: float) -> NoiseModel:
    """The noise by the logarithms of its deviations."""
    r_q, r_dq, q_dq = np.exp(logarithms).tolist()
    return NoiseModel(r_q, r_dq, 0.0, q_dq, q_tau)


def likeliest_walk(recordings: Sequence[Driven], noise: NoiseModel) -> float:
    """The walk of a sample that makes the innovations likeliest: where effort is present, as in section 7.3."""
    from scipy.optimize import minimize_scalar

    def unlikely(logarithm: float) -> float:
        walk = noise._replace(q_tau=float(np.exp(logarithm)))
        return -sum(ekf.log_likelihood(part, walk) for part in recordings)

    own = noise.q_tau or float(np.std(recordings[0].tau)) * recordings[0].T_s
    found = minimize_scalar(unlikely, bounds=(np.log(own) - FARTHEST, np.log(own) + FARTHEST), method="bounded")
    return float(np.exp(found.x))
