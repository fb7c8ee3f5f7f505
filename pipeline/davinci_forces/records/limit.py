"""Records of for which tissues a hand that feels them through a haptic device is stable."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Published, Record


@dataclass(frozen=True, eq=False)
class StabilityMap(Record):
    """Where a common quadratic Lyapunov function was found, over stiffnesses of hand and tissue.  Fig 8.9"""

    KEY = ("robot",)

    robot: str
    hand_mass: float
    hand_damping: float
    k_h: Column
    tissue_stiffness: Column
    has_cqlf: Counts


@dataclass(frozen=True, eq=False)
class StabilityLimit(Record):
    """The stiffest tissue over the stiffness of the hand, without delay."""

    KEY = ("robot",)

    robot: str
    hand_mass: float
    hand_damping: float
    k_h: Column
    k_t_cqlf: Column
    k_t_switching: Column


@dataclass(frozen=True, eq=False)
class DelayLimit(Record):
    """The stiffest tissue of one hand over how late the force comes."""

    KEY = ("robot",)
    UNKNOWN = ("k_t_leaving",)

    robot: str
    hand_mass: float
    hand_damping: float
    hand_stiffness: float
    link_rate: float
    k_t_cqlf: float
    k_t_switching: float
    delay: Column
    k_t_delay: Column
    k_t_held: Column
    k_t_leaving: Column

    def published(self) -> Iterator[Published]:
        """The hand, and its limits without delay."""
        names = ("hand_mass", "hand_damping", "hand_stiffness", "link_rate", "k_t_cqlf", "k_t_switching")
        yield from self.publish("stability", *names)


@dataclass(frozen=True, eq=False)
class TissueLimit(Record):
    """The tissue of one log beside the limits of that hand."""

    KEY = ("log",)

    log: str
    stiffness: float
    k_h_needed: float
    lag_of: str
    force_lag: float
    k_t_lag: float
    damping_needed: float

    def published(self) -> Iterator[Published]:
        """What the tissue asks of the hand, by the Lyapunov function and by the filter's lag."""
        yield from self.publish(f"stability.{self.log}", "k_h_needed", "force_lag", "k_t_lag", "damping_needed")


@dataclass(frozen=True, eq=False)
class HapticMotion(Record):
    """How a hand moves against tissue beyond the limits of arbitrary switching, by a law.  Fig 8.8, 8.10"""

    KEY = ("robot", "switching")

    robot: str
    switching: str
    tissue_stiffness: float
    t: Column
    hand_x: Column
    hand_dx: Column
    V: Column
