"""Open measurement logs: one module per format, tried in the order of `FORMATS`."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import Channel, Log, Options
from davinci_forces.maths.units import unit_after_groups

# Text last: it recognises anything that looks like columns of numbers. Raw binary goes by the file's suffix.
FORMATS = ("tdms", "lvm", "tdm", "ros", "mat", "hdf5", "arrow", "npz", "xlsx", "binary", "text")
BAG = ("metadata.yaml", "*.db3", "*.mcap")  # files in a folder that is a log: a ROS 2 bag


def open_log(path: Path, options: Options = Options()) -> Log:  # noqa: B008 - frozen
    """Open a log with the first format that recognises it.

    Raises BadLog if the file is not there, is empty, or no format recognises it.
    """
    if not path.exists():
        raise BadLog(f"{path}: there is no such file")
    inside = [file for pattern in BAG for file in sorted(path.glob(pattern))] if path.is_dir() else [path]
    if not inside:
        raise BadLog(f"{path}: this folder has no {' or '.join(BAG)}, so it is not a ROS 2 bag; name a file in it")
    with open_file(inside[0]) as file:
        head = file.read(4096)
    if not head:
        raise BadLog(f"{path}: the file is empty (0 bytes); record it again, or take it out of study.toml")
    for name in ("ros",) if path.is_dir() else ("binary",) if options.dtype else FORMATS:
        module = import_module(f"davinci_forces.logs.{name}")
        if options.dtype or module.recognises(path, head):
            log: Log = module.read(path, options)
            log.channels = tuple(_with_unit(channel) for channel in log.channels)
            return log
    raise BadLog(f"{path}: not a log of a known format ({', '.join(FORMATS)})")


def _with_unit(channel: Channel) -> Channel:
    """A channel with the unit that its name states, if the log states none."""
    is_quantity = channel.kind == "number" and not channel.derived
    unit = unit_after_groups(channel.name) if is_quantity and not channel.unit else ""
    return replace(channel, unit=unit) if unit else channel
