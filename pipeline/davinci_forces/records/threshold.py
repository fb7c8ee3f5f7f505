"""Records of how large an external effort has to be to stand out from free space."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Published, Record


@dataclass(frozen=True, eq=False)
class Threshold(Record):
    """The detection level that contacts on a joint are judged by: that of its worst free space."""

    KEY = ("joint", "filter")

    joint: str
    filter: str
    detection_level: float
    detection_level_std: float
    alarm_level: float
    alarm_level_std: float
    level_from: str  # the log whose free space it is

    def published(self) -> Iterator[Published]:
        """Both levels."""
        prefix = f"threshold.{self.joint}"
        for name in ("detection_level", "alarm_level"):
            yield Published(f"{prefix}.{name}", name, std=f"{name}_std")
