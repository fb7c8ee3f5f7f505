"""Records of how the joints' errors go together in one log."""

from dataclasses import dataclass

from davinci_forces.records.record import Record


@dataclass(frozen=True, eq=False)
class JointCorrelation(Record):
    """How the external efforts of the joints that carry the tip go together in one log, where nothing touches it."""

    KEY = ("log",)

    log: str
    tested: int
    rho_12: float
    rho_13: float
    rho_23: float
