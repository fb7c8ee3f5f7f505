"""Records of how the joints' errors go together in all logs."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Labels, Record


@dataclass(frozen=True, eq=False)
class ArmCorrelation(Record):
    """How the external efforts of the joints that carry the tip go together in free space, of at most 20 logs.

    What is taken of a log is made of the rows of the others.
    """

    KEY = ("robot",)

    robot: str
    source: Labels
    rho_12: Column
    rho_13: Column
    rho_23: Column
