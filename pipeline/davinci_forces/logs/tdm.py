"""Refuse TDM files of DIAdem, and say how to convert them to TDMS."""

from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Log, Options


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file is the description (.tdm) or the numbers (.tdx) of a TDM file."""
    return path.suffix.lower() in (".tdm", ".tdx") or (head.lstrip().startswith(b"<?xml") and b"usi:tdm" in head)


def read(path: Path, options: Options) -> Log:
    """Refuse the file by a BadLog, which says how to convert it to TDMS."""
    remedy = "save it as TDMS, with DIAdem or with LabVIEW's Convert to TDMS, and name that file in study.toml"
    raise BadLog(f"{path}: TDM files (.tdm, with their numbers in a .tdx) are not read; {remedy}")
