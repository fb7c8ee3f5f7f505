"""Recordings as files that LabVIEW would have written, TDMS and LVM; their headers say that they are simulated."""

from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from davinci_forces.simulation.sensors import SimulatedChannel

GROUP = "Motors"
SAYS = "SIMULATED data, not a recording of a robot"


def write(path: Path, channels: Sequence[SimulatedChannel], rate: float, started: str) -> None:
    """Write the channels in the format that the file's name asks for.

    A channel whose quantity is `time` is the first column or channel; without one the file's header says the step.
    """
    {".tdms": tdms, ".lvm": lvm}[path.suffix](path, channels, rate, started)


def named(path: Path, channel: SimulatedChannel) -> str:
    """The name by which a reader finds a channel in the file."""
    if path.suffix == ".tdms":
        return f"{GROUP}/{channel.name}"
    return "X_Value" if channel.quantity == "time" else channel.name


def tdms(path: Path, channels: Sequence[SimulatedChannel], rate: float, started: str) -> None:
    """Write a TDMS file of one group."""
    step = {} if channels[0].quantity == "time" else {"wf_start_offset": 0.0, "wf_increment": 1 / rate}
    root = RootObject({"name": path.stem, "description": SAYS, "started": started})
    objects = [
        ChannelObject(GROUP, c.name, np.ascontiguousarray(c.samples), {"unit_string": c.unit, **step}) for c in channels
    ]
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([root, GroupObject(GROUP), *objects])


def lvm(path: Path, channels: Sequence[SimulatedChannel], rate: float, started: str) -> None:
    """Write an LVM file of one file segment, as the express block "Write To Measurement File" does."""
    timed = channels[0].quantity == "time"
    columns = channels[1:] if timed else channels
    names = ["X_Value", *(c.name for c in columns), "Comment"]
    x = channels[0].samples[:, None] if timed else np.empty((len(columns[0].samples), 0))
    text = StringIO()
    np.savetxt(text, np.column_stack([x, *(c.samples for c in columns)]), "%.6f", delimiter="\t", newline="\r\n")
    rows = text.getvalue() if timed else "".join(f"\t{row}" for row in text.getvalue().splitlines(keepends=True))
    lines = [*_header(started, timed), *_segment(columns, rate, started), "\t".join(names)]
    path.write_bytes(("\r\n".join(lines) + "\r\n" + rows).encode())


def _header(started: str, timed: bool) -> list[str]:
    date, time = _date_time(started)
    entries = {
        "Writer_Version": "2", "Reader_Version": "2", "Separator": "Tab", "Decimal_Separator": ".",
        "Multi_Headings": "No", "X_Columns": "One" if timed else "No", "Time_Pref": "Relative",
        "Operator": "simulation", "Description": SAYS, "Date": date, "Time": time, "***End_of_Header***": "",
    }  # fmt: skip
    return ["LabVIEW Measurement\t", *(f"{key}\t{value}" for key, value in entries.items()), "\t"]


def _segment(columns: Sequence[SimulatedChannel], rate: float, started: str) -> list[str]:
    date, time = _date_time(started)
    entries = {
        "Samples": str(len(columns[0].samples)), "Date": date, "Time": time, "Y_Unit_Label": "", "X_Dimension": "Time",
        "X0": "0.0000000000000000E+0", "Delta_X": f"{1 / rate:.6f}", "***End_of_Header***": "",
    }  # fmt: skip
    lines = [f"Channels\t{len(columns)}" + "\t" * len(columns)]
    for key, value in entries.items():
        cells = [c.unit for c in columns] if key == "Y_Unit_Label" else [value] * len(columns)
        lines.append("\t".join([key, *cells, ""]))
    return lines


def _date_time(started: str) -> tuple[str, str]:
    date, _, time = started.partition("T")
    return date.replace("-", "/"), f"{time}.000000"
