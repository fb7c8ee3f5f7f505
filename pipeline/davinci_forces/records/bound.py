"""Records of how far the external effort of a joint can be off because the model is."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Labels, Published, Record


@dataclass(frozen=True, eq=False)
class ErrorBand(Record):
    """The errors of a joint's external effort in free motion that no fit had seen, of at most 20 logs, block by block.

    A log's own band is made of the rows of the others.
    """

    KEY = ("joint",)

    joint: str
    speed: float
    band_rms: float
    band_rms_std: float
    source: Labels
    path_of: Labels
    block: Counts
    speed_bin: Counts
    count: Counts
    mean_square: Column
    filter_square: Column
    log_mean: Column

    def published(self) -> Iterator[Published]:
        """The error over all rows."""
        yield Published(f"band.{self.joint}.band_rms", "band_rms", std="band_rms_std")
