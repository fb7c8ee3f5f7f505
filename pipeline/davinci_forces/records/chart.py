"""Records of friction over velocity."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class FrictionMap(Record):
    """What a fit's other terms leave of the effort of one joint in one log, and its friction, over velocity.

    Each row is the mean over a range of velocity, of samples that gain speed or of those that lose it.
    """

    KEY = ("log", "joint", "model", "estimator")

    log: str
    joint: str
    model: str
    estimator: str
    role: str
    dq: Column
    gaining: Counts
    tau_friction: Column
    tau_friction_std: Column
    tau_friction_hat: Column
