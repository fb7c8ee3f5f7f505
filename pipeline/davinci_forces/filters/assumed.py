"""What a filter assumes of a joint at a sampling rate, from what was settled for all of its logs."""

from davinci_forces.filters import DEFAULT, tracker
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.response import slowest
from davinci_forces.records import FilterNoise
from davinci_forces.robots.robot import Joint


def assumed(settled: FilterNoise, joint: Joint, T_s: float, q_tau: float, name: str = DEFAULT) -> NoiseModel:
    """The noise of a sample of T_s [s] for the filter of that name.

    The effort's noise drives the model, as an acceleration that is constant over a sample.  `q_tau` is the walk of the
    external effort [effort/s^0.5] that the settings name; where that is 0 the joint's own counts, and where that is
    0, too, the slowest with which this filter shows a push.
    """
    q_tau = q_tau or joint.q_tau
    noise = NoiseModel(settled.r_q, settled.r_dq, 0.0, settled.r_tau * T_s / settled.inertia, q_tau * T_s**0.5)
    return noise if q_tau else noise._replace(
        q_tau=slowest(tracker(name), settled.inertia, settled.viscous, T_s, noise)
    )  # fmt: skip
