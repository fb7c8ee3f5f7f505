"""One run at a time on a study: two would take each other's half written files away."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.errors import BadRequest

NAME = ".lock"  # there while a run lasts; a run that was killed leaves it, unlocked


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a processed folder.  The system lets go of it when the process ends, however it ends.

    Raises
    ------
    BadRequest
        If another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / NAME
    handle = _taken(file)
    if handle is None:
        raise BadRequest(f"{folder}: another run is working on this study; wait until it has ended, or stop it")
    try:
        yield
    finally:
        if sys.platform != "win32":
            file.unlink(missing_ok=True)  # while it is still held, so that nobody's else is removed
        os.close(handle)
        with suppress(OSError):  # Windows removes no file that is open: then it is another run's by now
            if sys.platform == "win32":
                file.unlink()


def _taken(file: Path) -> int | None:
    """The open and locked file, or None where another process holds it."""
    while True:
        handle = os.open(file, os.O_RDWR | os.O_CREAT)
        try:
            free = _lock(handle)
            # Between opening and locking, the run before may have removed the file: then nobody else would see it.
            current = free and os.path.samestat(os.fstat(handle), os.stat(file))
        except FileNotFoundError:
            current = False
        except BaseException:
            os.close(handle)
            raise
        if current:
            return handle
        os.close(handle)
        if not free:
            return None


if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> bool:
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _lock(handle: int) -> bool:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
