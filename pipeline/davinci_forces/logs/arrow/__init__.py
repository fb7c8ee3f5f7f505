"""Parquet and Feather (Arrow IPC) files: columns of numbers and times, with units from the field metadata."""

from functools import partial
from pathlib import Path

from davinci_forces.logs import isolated

read = partial(isolated.read, reader="davinci_forces.logs.arrow.table")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as one of these formats."""
    return head.startswith((b"PAR1", b"ARROW1\0\0"))
