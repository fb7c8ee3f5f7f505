"""Open measurement logs: one module per format, tried in the order of `FORMATS`."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import Log, Options
from davinci_forces.maths.units import unit_after_groups

# Text last: it recognises anything that looks like columns of numbers. Raw binary goes by the file's suffix.
FORMATS = ("tdms", "lvm", "tdm", "ros", "mat", "hdf5", "arrow", "npz", "xlsx", "binary", "text")
BAG = ("metadata.yaml", "*.db3", "*.mcap")  # files in a folder that is a log: a ROS 2 bag


def open_log(path: Path, options: Options = Options()) -> Log:  # noqa: B008 - frozen
    """Open a log with the first format that recognises it; raises BadLog if none does, or it is missing or empty."""
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
            log.channels = tuple(  # a name may state the unit
                replace(c, unit=c.unit or unit_after_groups(c.name)) if c.kind == "number" and not c.derived else c
                for c in log.channels
            )
            return log
    raise BadLog(f"{path}: not a log of a known format ({', '.join(FORMATS)})")
