"""Parquet and Feather (Arrow IPC) files: columns of numbers and times, with units from the field metadata."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

ARROW_BEGINNINGS = (b"PAR1", b"ARROW1\0\0", b"FEA1")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as one of these formats."""
    return head.startswith(ARROW_BEGINNINGS)


def read(path: Path, options: Options) -> Log:
    """Open the file; its schema describes the columns.

    Raises
    ------
    BadLog
        If it cannot be read.
    """
    return isolated.start(path, options, "davinci_forces.logs.arrow.table")
