"""What every filter is asked, and what it answers."""

from collections.abc import Callable
from typing import NamedTuple

from pipeline.maths.arrays import Array
from pipeline.maths.models.model import JointDynamics


class NoiseModel(NamedTuple):
    """Standard deviations of the measurements, and of what each state gains from one sample to the next."""

    r_q: float
    r_dq: float
    q_q: float
    q_dq: float
    q_tau: float  # of one step of the random walk


class Tracked(NamedTuple):
    """The filter's pass over (N,) samples: corrected state, its uncertainty, and how surprising each sample was."""

    q: Array
    dq: Array
    tau_ext: Array
    tau_ext_std: Array
    innovation_q: Array
    innovation_dq: Array
    nis: Array


# track(joint, q, dq, tau, T_s, noise, first_std)
Filter = Callable[[JointDynamics, Array, Array, Array, float, NoiseModel, float], Tracked]
