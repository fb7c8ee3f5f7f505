"""TDMS channels that need more than their bytes: raw values of DAQ cards, and scales that the file describes.

npTDMS reads these.  It is always given the open file, never its path: it would trust an index file of whatever
age and state in the same folder.
"""

import io
import logging
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

from pipeline.logs.log import Block
from pipeline.logs.tdms.metadata import names
from pipeline.logs.tdms.samples import ROWS

# What npTDMS knows; it would return values of any other scale unscaled.
SCALES = {
    "Polynomial",
    "Linear",
    "RTD",
    "Strain",
    "Table",
    "Thermistor",
    "Thermocouple",
    "Add",
    "Subtract",
    "AdvancedAPI",
}


class Part(io.RawIOBase):
    """The first `size` bytes of a file, for a reader that must not see the damage behind them."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self.file, self.size, self.at = file, size, 0

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a byte, as files do."""
        self.at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self.at, io.SEEK_END: self.size}[whence]
        return self.at

    def tell(self) -> int:
        """The byte that is read next."""
        return self.at

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer as far as there are bytes."""
        room = memoryview(buffer).cast("B")
        self.file.seek(self.at)
        data = self.file.read(max(0, min(len(room), self.size - self.at)))
        room[: len(data)] = data
        self.at += len(data)
        return len(data)


def is_scaled(properties: dict[str, Any]) -> bool:
    """Whether the values are still to be scaled as the properties say."""
    return properties.get("NI_Scaling_Status", "unscaled") != "scaled" and (
        int(properties.get("NI_Number_Of_Scales", 0)) > 0 or any(name.endswith("_Scale_Type") for name in properties)
    )


def unknown_scales(properties: dict[str, Any]) -> list[str]:
    """Kinds of scale that cannot be applied."""
    kinds = {str(value) for name, value in properties.items() if name.endswith("_Scale_Type")}
    return sorted(kinds - SCALES)


def pieces(file: BinaryIO, size: int, path: str) -> Iterator[Block]:
    """The scaled samples of a channel."""
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.set_level(logging.ERROR)  # what is amiss with the file we have said already
    group, channel = names(path)
    with TdmsFile.open(Part(file, size)) as opened:
        samples = opened[group][channel]
        for first in range(0, len(samples), ROWS):
            yield {path: np.asarray(samples[first : first + ROWS], dtype=np.float64)}
