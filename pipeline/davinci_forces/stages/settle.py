"""Settle what the filter assumes of every joint: the median over the logs that it was tuned to."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.records import FilterNoise, Tuning


def run(tunings: Iterable[Tuning]) -> Iterator[FilterNoise]:
    """One FilterNoise per joint; the inertia is the largest, with which the filter is slowest."""
    every: dict[str, list[Tuning]] = {}
    for tuning in tunings:
        every.setdefault(tuning.joint, []).append(tuning)
    for joint, own in every.items():
        r_q, r_dq, r_tau, q_tau, viscous, speed, rate = np.median(
            [(t.r_q, t.r_dq, t.r_tau, t.q_tau, t.viscous, t.speed, t.rate) for t in own], axis=0
        ).tolist()
        yield FilterNoise(
            joint=joint, logs=tuple(t.log for t in own), rate=rate, r_q=r_q, r_dq=r_dq, r_tau=r_tau, q_tau=q_tau,
            inertia=max(t.inertia for t in own), viscous=viscous, speed=speed,
        )  # fmt: skip
