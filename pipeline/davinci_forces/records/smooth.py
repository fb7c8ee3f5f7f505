"""Records of motion without the noise that differentiating would raise."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class Smoothed(Record):
    """The motion of one joint in one identification log, low-passed without delay, and its effort as recorded.

    The noise is what the low-pass takes out.  Where the joint stands still, friction takes any value up to its Coulomb
    level: nothing is fitted to its effort there, nor judged by it.
    """

    log: str
    joint: str
    rate: float
    at_rest: int
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    t: Column
    q: Column
    dq: Column
    ddq: Column
    tau: Column
    segment: Counts
    standing: Counts
