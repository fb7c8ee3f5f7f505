"""Records of what was measured, on a uniform clock."""

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
