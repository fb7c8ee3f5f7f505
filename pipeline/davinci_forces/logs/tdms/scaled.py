"""TDMS channels that need more than their bytes: raw values of DAQ cards, and scales that the file describes.

npTDMS reads these.  It is always given the open file, never its path: it would trust an index file of whatever
age and state in the same folder.
"""

import io
import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np

from davinci_forces.logs.log import Block
from davinci_forces.logs.tdms.metadata import names
from davinci_forces.logs.tdms.samples import ROWS

COUNT = "NI_Number_Of_Scales"
NUMBERED = re.compile(r"NI_Scale\[(\d{1,6})\]_")
MOST = 1000  # scales of a channel
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
        properties.get(COUNT, 0) not in (0, "0") or any(name.endswith("_Scale_Type") for name in properties)
    )


def problem(properties: dict[str, Any]) -> str:
    """Why the scales cannot be applied, or ""; a count that was damaged would have npTDMS look for billions."""
    kinds = {str(value) for name, value in properties.items() if name.endswith("_Scale_Type")}
    if unknown := sorted(kinds - SCALES):
        return f"has a scale of unknown kind: {', '.join(unknown)}"
    numbers = [int(match[1]) for name in properties if (match := NUMBERED.match(name))]
    count, most = properties.get(COUNT, 0), max([0, *numbers]) + 1
    if not isinstance(count, int) or not 0 <= count <= min(most, MOST):
        return f"says that it has {count!r} scales and describes {len(kinds)}: the file is damaged; record it again"
    return ""


def applied(read: Iterator[Block], scales: Mapping[str, dict[str, Any]]) -> Iterator[Block]:
    """The samples with those of some channels scaled as their properties say.

    npTDMS would read all of a chunk for every piece of it, which takes as long as their product.
    """
    from nptdms.base_segment import RawChannelDataChunk
    from nptdms.scaling import get_scaling

    of = {path: scaling for path, said in scales.items() if (scaling := get_scaling(said, {}, {}))}
    for piece in read:
        raw = {path: RawChannelDataChunk.channel_data(piece[path]) for path in of}
        yield piece | {path: np.asarray(each.scale(raw[path]), np.float64) for path, each in of.items()}


def pieces(file: BinaryIO, size: int, paths: Sequence[str], chunk: int) -> Iterator[Block]:
    """The scaled samples of channels that always come together; `chunk` is how many of each do."""
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.set_level(logging.ERROR)  # what is amiss with the file we have said already
    with TdmsFile.open(Part(file, size)) as opened:
        of = {path: names(path) for path in paths}
        if chunk <= ROWS:
            for each in opened.data_chunks():
                yield {path: np.asarray(each[g][c][:], dtype=np.float64) for path, (g, c) in of.items()}
            return
        channels = {path: opened[group][channel] for path, (group, channel) in of.items()}
        for first in range(0, len(channels[paths[0]]), ROWS):
            yield {path: np.asarray(c[first : first + ROWS], dtype=np.float64) for path, c in channels.items()}
