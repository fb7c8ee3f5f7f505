"""How measurements come in: one module per log format, tried in this order."""

from importlib import import_module
from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import Log, Options

# Text last: it recognises whatever looks like columns of numbers, and raw binary whatever has that name before it.
FORMATS = ("tdms", "lvm", "tdm", "ros", "mat", "hdf5", "arrow", "binary", "text")
BAG = "metadata.yaml"  # what a folder holds that is a log: a bag of ROS 2


def open_log(path: Path, options: Options = Options()) -> Log:  # noqa: B008 - frozen
    """Open a log of whichever format recognises it.

    Raises
    ------
    BadLog
        If the file is not there, is empty, or no format recognises it.
    """
    if not path.exists():
        raise BadLog(f"{path}: there is no such file")
    if path.is_dir() and not (path / BAG).is_file():
        raise BadLog(f"{path}: it is a folder without {BAG}, so it is no bag of ROS 2; name a file in it")
    with open_file(path / BAG if path.is_dir() else path) as file:
        head = file.read(4096)
    if not head:
        raise BadLog(f"{path}: the file is empty (0 bytes); record it again, or take it out of study.toml")
    for name in ("ros",) if path.is_dir() else ("binary",) if options.dtype else FORMATS:
        module = import_module(f"davinci_forces.logs.{name}")
        if options.dtype or module.recognises(path, head):
            log: Log = module.read(path, options)
            return log
    raise BadLog(f"{path}: not a log of a known format ({', '.join(FORMATS)})")
