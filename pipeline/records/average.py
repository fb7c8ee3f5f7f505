"""Records of averaged periods: the mean, and what averaging removes."""

from dataclasses import dataclass

from pipeline.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class Average(Record):
    """One period of a joint, averaged over the periods of a recording, with the spread between them."""

    log: str
    joint: str
    rate: float
    period: float
    period_std: float
    stated_period: float
    periods: int
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    t: Column
    q: Column
    dq: Column
    tau: Column
    q_var: Column
    dq_var: Column
    tau_var: Column
    count: Counts


@dataclass(frozen=True, eq=False)
class PeriodResidual(Record):
    """What averaging removed: each sample minus the mean of the periods at its phase."""

    log: str
    joint: str
    t: Column
    q_noise: Column
    dq_noise: Column
    tau_noise: Column
