"""Records of contacts."""

from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.records.record import Column, Counts, Published, Record


@dataclass(frozen=True, eq=False)
class Contact(Record):
    """The windows of contact of one log: what one joint exerted on its environment, against its detection level."""

    log: str
    joint: str
    filter: str
    detection_level: float
    level_from: str  # the log whose free space sets the detection level
    onset: Column
    release: Column
    peak: Column
    peak_std: Column
    mean: Column
    mean_std: Column
    impulse: Column
    impulse_std: Column
    above: Counts

    def published(self) -> Iterator[Published]:
        """Every window, numbered from 1."""
        for i in range(len(self)):
            prefix = f"contact.{self.log}.{self.joint}.{i + 1}"
            for name in ("peak", "mean", "impulse"):
                yield Published(f"{prefix}.{name}", name, std=f"{name}_std", row=i)
            for name in ("onset", "release", "above"):
                yield Published(f"{prefix}.{name}", name, row=i)
