"""The innovations of the default filter, each with the standard deviation that the filter states.

    S = H P H' + R,    NIS_q = i_q^2 / S_qq ~ chi^2(1),    NIS_dq = i_dq^2 / S_dd ~ chi^2(1)

Errors of a recording's clock, estimated from the other joints: a late sample shifts every joint that moves.

    i_j = v_j + dq_j delta,    delta_j = sum_(i != j) w_i dq_i i_i / (1 / s^2 + sum_(i != j) w_i dq_i^2),    w = 1 / r^2

i are innovations of position, s is the standard deviation of the times, and r that of the innovations at rest.  s and r
follow from a line fitted to the squared innovations over the squared velocity.  A joint's own innovation does not enter
its delta.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import rts
from davinci_forces.filters.problem import FilterInput, NoiseModel, Recording
from davinci_forces.maths.arrays import Array

MIN_SHARE_AT_REST = 1e-3  # least share of an innovation's variance that is not due to the clock


class Innovations(NamedTuple):
    """Innovations (N,) of position and velocity, and their stated standard deviations."""

    q: Array
    dq: Array
    q_std: Array
    dq_std: Array


def innovations(recording: Recording, noise: NoiseModel) -> Innovations:
    """Compute the innovations of `ekf`, number for number, by the smoother's forward pass.  (7.6), (7.7)"""
    result = Innovations(*(np.empty(recording.samples) for _ in Innovations._fields))
    for rows, _, (i_q, i_dq, _), predicted in rts.forwards(recording, noise):
        stds = np.sqrt(predicted[:, 3] + noise.r_q**2), np.sqrt(predicted[:, 6] + noise.r_dq**2)
        for column, values in zip(result, (i_q, i_dq, *stds), strict=True):
            column[rows] = values
    return result


def delays(velocities: Sequence[Array], innovations: Sequence[Array]) -> list[Array]:
    """Estimate how late [s] each sample (N,) was taken: for each joint, from all others; 0 where there is none."""
    variances = [fit_variances(dq, i) for dq, i in zip(velocities, innovations, strict=True)]
    numerators = [dq * i / r2 for dq, i, (r2, _) in zip(velocities, innovations, variances, strict=True)]
    weights = [dq**2 / r2 for dq, (r2, _) in zip(velocities, variances, strict=True)]
    estimates: list[Array] = []
    for j in range(len(velocities)):
        others = [i for i in range(len(velocities)) if i != j]
        s2 = float(np.median([variances[i][1] for i in others])) if others else 0.0
        if s2 <= 0.0:
            estimates.append(np.zeros_like(velocities[j]))
            continue
        numerator, weight = (np.sum([terms[i] for i in others], axis=0) for terms in (numerators, weights))
        estimates.append(numerator / (1.0 / s2 + weight))
    return estimates


def correct_times(recording: FilterInput, dq: Array, ddq: Array, late: Array) -> FilterInput:
    """Correct a recording to even times, by its velocity and acceleration (N,) without noise."""
    return recording._replace(q=recording.q - dq * late, dq=recording.dq - ddq * late)


def fit_variances(dq: Array, innovation: Array) -> tuple[float, float]:
    """Fit the variance of an innovation at rest, r^2, and that of the times, s^2: E i^2 = r^2 + s^2 dq^2."""
    Phi = np.column_stack([np.ones_like(dq), dq**2])
    (r2, s2), *_ = np.linalg.lstsq(Phi, innovation**2, rcond=None)
    return max(float(r2), MIN_SHARE_AT_REST * float(np.mean(innovation**2))), max(float(s2), 0.0)
