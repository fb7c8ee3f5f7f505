"""What every filter is asked, and what it answers."""

from collections.abc import Callable
from typing import NamedTuple

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.driven import Driven


class NoiseModel(NamedTuple):
    """Standard deviations of the measurements, and of what each state gains from one sample to the next."""

    r_q: float
    r_dq: float
    q_q: float
    q_dq: float  # by an acceleration that is constant over the sample, which moves q by half of T_s q_dq
    q_tau: float  # of one step of the random walk


class Tracked(NamedTuple):
    """A filter's pass over (N,) samples: its state, how uncertain it is, and how surprising each sample was.

    A filter without innovations leaves them 0, and `nis`, too.
    """

    q: Array
    dq: Array
    tau_ext: Array
    tau_ext_std: Array
    innovation_q: Array
    innovation_dq: Array
    nis: Array


# track(recording, noise)
Filter = Callable[[Driven, NoiseModel], Tracked]
