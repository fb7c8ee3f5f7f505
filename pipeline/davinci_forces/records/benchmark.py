"""Records of what other filters would have made of a log."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Published, Record


@dataclass(frozen=True, eq=False)
class Comparison(Record):
    """One filter on one joint of a log: what it makes of free space, and of a push that was added in software.

    Of the default filter the free space is said in FreeSpace.
    """

    KEY = ("log", "joint", "filter")

    log: str
    joint: str
    filter: str
    role: str
    default: int
    free_rms: float
    free_rms_std: float
    free_level: float
    free_level_std: float
    detection_level: float
    detection_level_std: float
    push_peak: float
    push_share: float
    push_delay: float
    t: Column
    tau_ext: Column

    def published(self) -> Iterator[Published]:
        """Its levels in free space, and how much of a push it shows, how late."""
        prefix = f"{self.filter}.{self.log}.{self.joint}"
        if not self.default:
            for name in ("free_rms", "free_level", "detection_level"):
                yield Published(f"{prefix}.{name}", name, std=f"{name}_std")
        yield from self.publish(prefix, "push_share", "push_delay")
