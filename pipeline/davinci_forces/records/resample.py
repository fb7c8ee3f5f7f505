"""Records of what was measured, on a uniform clock, and of its motion without noise."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class Signal(Record):
    """One joint during one log on a uniform clock, with its velocity; a gap starts a new segment."""

    log: str
    joint: str
    role: str
    rate: float
    method: str
    velocity: str
    gaps: int
    at_rest: int
    t: Column
    q: Column
    dq: Column
    tau: Column
    segment: Counts


@dataclass(frozen=True, eq=False)
class Motion(Record):
    """The motion of one joint during one log, low-passed without delay, beside what was measured of it.

    The noise is what the low-pass takes out.  Where the joint stands still, friction takes any value up to its Coulomb
    level: nothing is fitted to its effort there.
    """

    log: str
    joint: str
    role: str
    rate: float
    velocity: str
    cutoff: float
    effort_lag: float
    at_rest: int
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    t: Column
    q: Column
    dq: Column
    ddq: Column
    q_measured: Column
    dq_measured: Column
    tau: Column
    segment: Counts
    standing: Counts
