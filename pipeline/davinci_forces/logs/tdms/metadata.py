"""Parse the metadata of a TDMS file segment: its objects, the layout of their samples, and their properties.

Source: National Instruments ("TDMS File Format Internal Structure").
"""

import struct
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np

from davinci_forces.logs.log import BadContent
from davinci_forces.logs.timeline import moment

NO_DATA, AS_BEFORE = 0xFFFFFFFF, 0
DAQMX, DIGITAL = 0x1269, 0x126A  # unscaled raw data of a DAQ card
STRING, BOOLEAN, TIME, DAQMX_RAW = 0x20, 0x21, 0x44, 0xFFFFFFFF
NUMBER_CODES = {
    1: "i1", 2: "i2", 3: "i4", 4: "i8", 5: "u1", 6: "u2", 7: "u4", 8: "u8", 9: "f4", 10: "f8",
    0x19: "f4", 0x1A: "f8", BOOLEAN: "u1",
}  # fmt: skip
COMPLEX = (0x08000C, 0x10000D)
SIZES = {0x1B: 16, TIME: 16, COMPLEX[0]: 8, COMPLEX[1]: 16}  # [bytes] of one value, except text
SIZES |= {kind: np.dtype(code).itemsize for kind, code in NUMBER_CODES.items()}
EPOCH = datetime(1904, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class Samples:
    """Layout of the samples of one channel in one chunk of a file segment."""

    kind: int  # NI's number of the data type
    count: int  # in a chunk
    octets: int  # of all samples
    widths: tuple[int, ...] = ()  # DAQmx: bytes of a row in each of the card's buffers, which the channels share


@dataclass
class Objects:
    """Accumulated metadata of the file segments read so far."""

    latest: dict[str, Samples] = field(default_factory=dict)  # by path: the last layout
    active: dict[str, Samples] = field(default_factory=dict)  # channels with data in this file segment, in order
    properties: dict[str, dict[str, Any]] = field(default_factory=dict)  # by path: the last values
    revised: dict[str, dict[str, Any]] = field(default_factory=dict)  # by path: the first values of changed ones

    def update(self, metadata: bytes, order: str, renew: bool) -> None:
        """Add the metadata of one file segment; raises BadContent if it is truncated, or cannot be parsed."""
        take = _Cursor(metadata, order)
        self.active = {} if renew else dict(self.active)
        try:
            for _ in range(take.number("I")):
                path = take.text()
                properties = self.properties.setdefault(path, {})
                header = take.number("I")
                if header == NO_DATA:
                    self.active.pop(path, None)
                else:
                    self.latest[path] = self.latest[path] if header == AS_BEFORE else take.samples(header)
                    self.active[path] = self.latest[path]
                for _ in range(take.number("I")):
                    name, value = take.text(), take.value(take.number("I"))
                    if properties.get(name) not in (None, "", value):
                        self.revised.setdefault(path, {}).setdefault(name, properties[name])
                    properties[name] = value
        except (struct.error, IndexError, UnicodeDecodeError, KeyError, OverflowError) as error:
            raise BadContent(f"its metadata cannot be parsed after {take.at} bytes ({error})") from None


class _Cursor:
    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order, self.at = data, order, 0

    def number(self, code: str) -> int:
        (value,) = struct.unpack_from(self.order + code, self.data, self.at)
        self.at += struct.calcsize(self.order + code)
        return int(value)

    def bytes(self, length: int) -> bytes:
        if self.at + length > len(self.data):
            raise IndexError(f"{length} bytes are needed, but {len(self.data) - self.at} are left")
        self.at += length
        return self.data[self.at - length : self.at]

    def text(self) -> str:
        raw = self.bytes(self.number("I"))
        try:
            return raw.decode()
        except UnicodeDecodeError:
            return raw.decode("cp1252")

    def value(self, kind: int) -> Any:
        """Read a property."""
        if kind == STRING:
            return self.text()
        if kind == TIME:
            return self.moment()
        if kind in NUMBER_CODES:
            code = np.dtype(self.order + NUMBER_CODES[kind])
            return np.frombuffer(self.bytes(code.itemsize), code)[0].item()
        return self.bytes(SIZES[kind])

    def moment(self) -> datetime | None:
        """Read a time stamp; None beyond the range of dates."""
        parts = {code: self.number(code) for code in ("Qq" if self.order == "<" else "qQ")}  # fraction and seconds
        return moment(EPOCH, parts["q"], round(parts["Q"] / 2**64 * 1e6))

    def samples(self, header: int) -> Samples:
        kind, dimension, count = self.number("I"), self.number("I"), self.number("Q")
        if dimension != 1:
            raise IndexError(f"an array of {dimension} dimensions; TDMS 2.0 allows only one")
        if header in (DAQMX, DIGITAL):
            for _ in range(self.number("I")):
                self.bytes(20 if header == DAQMX else 17)
            widths = tuple(self.number("I") for _ in range(self.number("I")))
            return Samples(DAQMX_RAW, count, 0, widths)
        if kind == STRING:
            return Samples(kind, count, self.number("Q"))
        return Samples(kind, count, count * SIZES[kind])


def names(path: str) -> tuple[str, ...]:
    """Split an object's path into group and channel: `/'Motors'/'Roll''s current'` -> `Motors`, `Roll's current`."""
    return tuple(part.replace("''", "'") for part in path[2:-1].split("'/'")) if len(path) > 1 else ()
