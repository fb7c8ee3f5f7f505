"""TDM files of DIAdem, which are read as TDMS: how to make one of the other."""

from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Log, Options


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is the description or the numbers of a TDM file."""
    return path.suffix.lower() in (".tdm", ".tdx") or (head.lstrip().startswith(b"<?xml") and b"usi:tdm" in head)


def read(path: Path, options: Options) -> Log:
    """Say how to make a TDMS file of it.

    Raises
    ------
    BadLog
        Always.
    """
    raise BadLog(
        f"{path}: it is a TDM file (.tdm, with its numbers in a .tdx), which is not read: save as TDMS, by DIAdem or "
        "by LabVIEW's Convert to TDMS, and name that file in study.toml"
    )
