"""Parquet and Feather (Arrow IPC) files: their columns of numbers and times; units by the fields' metadata."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

BEGINNINGS = (b"PAR1", b"ARROW1\0\0", b"FEA1")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as one of these formats."""
    return head.startswith(BEGINNINGS)


def read(path: Path, options: Options) -> Log:
    """Open the file: its schema says what its columns are.

    Raises
    ------
    BadLog
        If it cannot be read.
    """
    return isolated.start(path, options, "davinci_forces.logs.arrow.table")
