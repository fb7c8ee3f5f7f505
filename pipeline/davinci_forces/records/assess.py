"""Records of how large an external effort looks where nothing touches the robot."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Published, Record


@dataclass(frozen=True, eq=False)
class FreeSpace(Record):
    """The external effort that one filter states on one joint of one log, where nothing touched the robot."""

    log: str
    joint: str
    filter: str
    role: str
    tested: int
    free_rms: float
    free_rms_std: float
    free_level: float
    free_level_std: float
    detection_level: float
    detection_level_std: float
    coverage: float
    coverage_std: float
    smooth_rms: float
    smooth_max: float
    crossings: float

    def published(self) -> Iterator[Published]:
        """The levels, and the coverage of the stated band."""
        prefix = f"{self.filter}.{self.log}.{self.joint}"
        for name in ("free_rms", "free_level", "detection_level", "coverage"):
            yield Published(f"{prefix}.{name}", name, std=f"{name}_std")
