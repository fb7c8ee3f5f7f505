"""Records of the noise that a filter assumes."""

from dataclasses import dataclass

from davinci_forces.records.record import Record


@dataclass(frozen=True, eq=False)
class Tuning(Record):
    """The noise of one joint in one identification log, as the likelihood of a filter's innovations has it."""

    log: str
    joint: str
    rate: float
    r_q: float
    r_dq: float
    r_tau: float
    q_tau: float
    inertia: float
    viscous: float
    speed: float
    likelihood_gain: float
    tested: int
