"""One run at a time on a study: two would take each other's half written files away."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from davinci_forces.errors import BadRequest

NAME = ".lock"  # it stays when a run has ended: what counts is whether a process holds it


@contextmanager
def locked(folder: Path) -> Iterator[bool]:
    """Hold the lock of a processed folder.  The system lets go of it when the process ends, however it ends.

    A folder that cannot be written to needs no lock, and gets none: whether it is held is what the context gives.

    Raises
    ------
    BadRequest
        If another process holds it.
    """
    if folder.is_dir() and not os.access(folder, os.W_OK):
        yield False
        return
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / NAME, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        said = f"{folder}: another run is working on this study; wait until it has ended, or stop it"
        raise BadRequest(said) from None
    try:
        yield True
    finally:
        lock.release()
