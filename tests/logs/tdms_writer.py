"""A writer of TDMS segments in the layouts that npTDMS does not write: interleaved, big-endian, without metadata."""

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = {"i1": 1, "i2": 2, "i4": 3, "i8": 4, "u1": 5, "u2": 6, "u4": 7, "u8": 8, "f4": 9, "f8": 10}
METADATA, NEW_LIST, RAW, INTERLEAVED, BIG_ENDIAN, DAQMX = 2, 4, 8, 32, 64, 128
FORMAT_CHANGING, RAW_DAQMX, INT16 = 0x1269, 0xFFFFFFFF, 3


def segment(
    channels: Mapping[str, NDArray[Any]],
    interleaved: bool = False,
    order: str = "<",
    described: bool = True,
    chunks: int = 1,
    units: Mapping[str, str] | None = None,
    steps: Mapping[str, float] | None = None,
) -> bytes:
    """A segment: its channels, whose samples are split into `chunks`; without metadata it continues the one before."""
    metadata = _metadata(channels, order, chunks, units or {}, steps or {}) if described else b""
    raw = _interleaved(channels, order) if interleaved else _contiguous(channels, order, chunks)
    toc = RAW | (METADATA | NEW_LIST if described else 0)
    toc |= (INTERLEAVED if interleaved else 0) | (BIG_ENDIAN if order == ">" else 0)
    lead = struct.pack(order + "IQQ", 4713, len(metadata) + len(raw), len(metadata))
    return b"TDSm" + struct.pack("<I", toc) + lead + metadata + raw


def _metadata(
    channels: Mapping[str, NDArray[Any]], order: str, chunks: int, units: Mapping[str, str], steps: Mapping[str, float]
) -> bytes:
    def text(words: str) -> bytes:
        return struct.pack(order + "I", len(words.encode())) + words.encode()

    parts = [struct.pack(order + "I", len(channels))]
    for name, samples in channels.items():
        group, channel = (part.replace("'", "''") for part in name.split("/", 1))
        parts.append(text(f"/'{group}'/'{channel}'"))
        kind = KINDS[samples.dtype.str[1:]]
        parts.append(struct.pack(order + "IIIQ", 20, kind, 1, len(samples) // chunks))
        unit, step = units.get(name), steps.get(name)
        parts.append(struct.pack(order + "I", bool(unit) + bool(step)))
        if unit:
            parts.append(text("unit_string") + struct.pack(order + "I", 0x20) + text(unit))
        if step:
            parts.append(text("wf_increment") + struct.pack(order + "Id", 10, step))
    return b"".join(parts)


def _interleaved(channels: Mapping[str, NDArray[Any]], order: str) -> bytes:
    dtype = np.dtype([(name, samples.dtype.newbyteorder(order)) for name, samples in channels.items()])
    rows = np.empty(len(next(iter(channels.values()))), dtype)
    for name, samples in channels.items():
        rows[name] = samples
    return rows.tobytes()


def _contiguous(channels: Mapping[str, NDArray[Any]], order: str, chunks: int) -> bytes:
    parts = [np.array_split(samples.astype(samples.dtype.newbyteorder(order)), chunks) for samples in channels.values()]
    return b"".join(part[i].tobytes() for i in range(chunks) for part in parts)


def daqmx(channels: Mapping[str, NDArray[np.int16]], slope: float, chunks: int = 1) -> bytes:
    """A segment as a DAQ card leaves it: the channels' raw values side by side, to be scaled to `slope` * raw + 1."""
    many, rows = len(channels), len(next(iter(channels.values())))
    parts = [struct.pack("<I", many)]
    for i, name in enumerate(channels):
        group, channel = name.split("/", 1)
        parts.append(_text(f"/'{group}'/'{channel}'"))
        parts.append(struct.pack("<IIIQ", FORMAT_CHANGING, RAW_DAQMX, 1, rows // chunks))
        # One scaler: its type, buffer, offset in a row, format, number; then one buffer, as wide as a row.
        parts.append(struct.pack("<I5I", 1, INT16, 0, 2 * i, 0, 0) + struct.pack("<II", 1, 2 * many))
        parts.append(struct.pack("<I", 5))
        parts.append(_text("NI_Number_Of_Scales") + struct.pack("<Ii", 3, 2))
        parts.append(_text("NI_Scale[1]_Scale_Type") + struct.pack("<I", 0x20) + _text("Linear"))
        parts.append(_text("NI_Scale[1]_Linear_Input_Source") + struct.pack("<II", 7, 0))
        parts.append(_text("NI_Scale[1]_Linear_Slope") + struct.pack("<Id", 10, slope))
        parts.append(_text("NI_Scale[1]_Linear_Y_Intercept") + struct.pack("<Id", 10, 1.0))
    metadata, raw = b"".join(parts), np.column_stack(list(channels.values())).astype("<i2").tobytes()
    lead = struct.pack("<IIQQ", METADATA | NEW_LIST | RAW | DAQMX, 4713, len(metadata) + len(raw), len(metadata))
    return b"TDSm" + lead + metadata + raw


def _text(words: str) -> bytes:
    return struct.pack("<I", len(words.encode())) + words.encode()
