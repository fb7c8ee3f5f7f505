"""Records of what a filter assumes of a joint in every log."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Names, Published, Record


@dataclass(frozen=True, eq=False)
class FilterNoise(Record):
    """The noise that the filter assumes of a joint: the median of its identification logs."""

    KEY = ("joint",)

    joint: str
    logs: Names
    rate: float
    r_q: float
    r_dq: float
    r_tau: float
    q_tau: float
    inertia: float
    viscous: float
    speed: float

    def published(self) -> Iterator[Published]:
        """The noise, and the walk that shows a push at the rate of the identification logs."""
        yield from self.publish(f"tuning.{self.joint}", "r_q", "r_dq", "r_tau", "q_tau")
