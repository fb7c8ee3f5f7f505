"""Records of a simulated hand that feels tissue through the arm, its filter and a link."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Published, Record


@dataclass(frozen=True, eq=False)
class HapticResponse(Record):
    """What lies between a hand in the tissue and the force that it feels, over the frequency of its motion."""

    KEY = ("robot",)

    robot: str
    arm_from: str
    tissue_stiffness: float
    at_frequency: float
    rendered_stiffness: float
    transparency: float
    felt_delay: float
    frequency: Column
    felt_share: Column
    felt_late: Column

    def published(self) -> Iterator[Published]:
        """The tissue as it is and as it is felt."""
        names = ("tissue_stiffness", "at_frequency", "rendered_stiffness", "transparency", "felt_delay")
        yield from self.publish("haptics", *names)


@dataclass(frozen=True, eq=False)
class HapticRun(Record):
    """One hand going in and out of the tissue, what it feels, and how far it is from unstable.  Fig 8.12"""

    KEY = ("hand",)

    hand: str
    hand_mass: float
    hand_damping: float
    hand_stiffness: float
    out_of_reach: int
    true_peak: float
    felt_peak: float
    felt_error: float
    k_t_settles: float
    k_t_response: float
    stiffness_margin: float
    delay_margin: float
    t: Column
    plan_x: Column
    hand_x: Column
    arm_x: Column
    true_force: Column
    felt_force: Column

    def published(self) -> Iterator[Published]:
        """The hand, the forces, and the margins."""
        names = ("hand_mass", "hand_damping", "hand_stiffness", "out_of_reach", "true_peak", "felt_peak", "felt_error")
        margins = ("k_t_settles", "k_t_response", "stiffness_margin", "delay_margin")
        yield from self.publish(f"haptics.{self.hand}", *names, *margins)
