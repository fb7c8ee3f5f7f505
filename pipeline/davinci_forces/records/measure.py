"""Records of contacts."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Published, Record


@dataclass(frozen=True, eq=False)
class Contact(Record):
    """The contacts of one log: what one joint exerted on its environment, against its detection level.

    The windows that the study states come first, then what was found beside them.  A window in which nothing was found
    begins and ends as it is stated.
    """

    log: str
    joint: str
    filter: str
    detection_level: float
    alarm_level: float
    level_from: str  # the log whose free space sets the detection level
    stated: Counts
    found: Counts
    onset: Column
    onset_std: Column
    release: Column
    release_std: Column
    duration: Column
    duration_std: Column
    peak: Column
    peak_std: Column
    mean: Column
    mean_std: Column
    impulse: Column
    impulse_std: Column
    above: Counts

    def published(self) -> Iterator[Published]:
        """Every contact, numbered from 1."""
        for i in range(len(self)):
            prefix = f"contact.{self.log}.{self.joint}.{i + 1}"
            for name in ("peak", "mean", "impulse", "onset", "release", "duration"):
                yield Published(f"{prefix}.{name}", name, std=f"{name}_std", row=i)
            for name in ("above", "stated", "found"):
                yield Published(f"{prefix}.{name}", name, row=i)
