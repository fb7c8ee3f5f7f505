"""How measurements come in: one module per log format, tried in this order."""

from importlib import import_module
from pathlib import Path

from pipeline.errors import BadLog
from pipeline.logs.log import Log, Options

FORMATS = ("tdms", "lvm", "text")  # text last: it recognises whatever looks like columns of numbers


def open_log(path: Path, options: Options = Options()) -> Log:  # noqa: B008 - frozen
    """Open a log of whichever format recognises it.

    Raises
    ------
    BadLog
        If the file is not there, is empty, or no format recognises it.
    """
    if not path.is_file():
        raise BadLog(f"{path}: there is no such file")
    with path.open("rb") as file:
        head = file.read(4096)
    if not head:
        raise BadLog(f"{path}: the file is empty (0 bytes); record it again, or take it out of study.toml")
    for name in FORMATS:
        module = import_module(f"pipeline.logs.{name}")
        if module.recognises(path, head):
            log: Log = module.read(path, options)
            return log
    raise BadLog(f"{path}: not a log of a known format ({', '.join(FORMATS)})")
