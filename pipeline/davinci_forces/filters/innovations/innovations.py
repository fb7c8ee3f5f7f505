"""The innovations of the default filter, each with the deviation that the filter states of it.

S = H P H' + R,    NIS_q = i_q^2 / S_qq,    NIS_dq = i_dq^2 / S_dd ~ chi^2(1), each by itself

Errors of a recording's clock, told by the other joints: a sample taken late shows on every joint that moves.

    i_j = v_j + dq_j delta,    delta_j = sum_(i != j) w_i dq_i i_i / (1 / s^2 + sum_(i != j) w_i dq_i^2),    w = 1 / r^2

i are innovations of position, s is the deviation of the times and r that of what is not due to them; both are told by
how the squares of the innovations grow with those of the velocity.  A joint's own innovation has no say in its delta.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import rts
from davinci_forces.filters.problem import Driven, NoiseModel
from davinci_forces.maths.arrays import Array

LEAST = 1e-3  # of an innovation's variance that is never due to the clock


class Innovations(NamedTuple):
    """Of (N,) samples: position and velocity, and their stated standard deviations."""

    q: Array
    dq: Array
    q_std: Array
    dq_std: Array


def innovations(recording: Driven, noise: NoiseModel) -> Innovations:
    """Those of `ekf`, number for number, from the smoother's pass forwards.  (7.6), (7.7)"""
    (i_q, i_dq, _), predicted = rts.forwards(recording, noise)
    return Innovations(i_q, i_dq, np.sqrt(predicted[:, 3] + noise.r_q**2), np.sqrt(predicted[:, 6] + noise.r_dq**2))


def delays(velocities: Sequence[Array], innovations: Sequence[Array]) -> list[Array]:
    """How late [s] each sample (N,) was taken, for each joint by all others."""
    told = [spread(dq, i) for dq, i in zip(velocities, innovations, strict=True)]
    top = [dq * i / rest for dq, i, (rest, _) in zip(velocities, innovations, told, strict=True)]
    bottom = [dq**2 / rest for dq, (rest, _) in zip(velocities, told, strict=True)]
    made: list[Array] = []
    for j in range(len(velocities)):
        others = [i for i in range(len(velocities)) if i != j]
        variance = float(np.median([told[i][1] for i in others])) if others else 0.0
        if variance <= 0.0:
            made.append(np.zeros_like(velocities[j]))
            continue
        above, below = (np.sum([each[i] for i in others], axis=0) for each in (top, bottom))
        made.append(above / (1.0 / variance + below))
    return made


def mended(recording: Driven, dq: Array, ddq: Array, late: Array) -> Driven:
    """A recording as it would be at even times, by its velocity and acceleration (N,) without noise."""
    return recording._replace(q=recording.q - dq * late, dq=recording.dq - ddq * late)


def spread(dq: Array, innovation: Array) -> tuple[float, float]:
    """The variance of an innovation at rest and that of the times, E i^2 = r^2 + s^2 dq^2."""
    Phi = np.column_stack([np.ones_like(dq), dq**2])
    (rest, late), *_ = np.linalg.lstsq(Phi, innovation**2, rcond=None)
    return max(float(rest), LEAST * float(np.mean(innovation**2))), max(float(late), 0.0)
