"""A lock that lets one run at a time work on a study: two runs would remove each other's half-written files.

Where the file system can lock files, the system locks the file `.lock`.  Elsewhere `.lock` is a folder of one file,
whose name identifies the holder.  No folder replaces a folder with a file, and only one run can rename the file of a
run that has ended.
"""

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from pathlib import Path
from urllib.parse import parse_qsl, urlencode
from uuid import uuid4

from davinci_forces.errors import BadRequest

NAME = ".lock"  # the file stays after a run; the lock is in force only while a process holds it
BUSY, REMEDY = "another run is working on this study", "wait until it has ended, or stop it"
MAX_TRIES = 100  # attempts to take a lock while other runs take and release it
OPEN_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # never wait
LOCKED_BYTE = 1 << 30  # byte that Windows locks, so that other processes can read the bytes before it


@dataclass(frozen=True)
class Holder:
    """A process that holds a lock."""

    host: str
    process: str
    start: str  # of the process, since its number may be used again
    taken: str

    @property
    def name(self) -> str:
        """The fields as the name of a file."""
        return urlencode(vars(self))

    def require_end(self, folder: Path, file: Path) -> None:
        """Raise `BadRequest` unless this process, which holds the lock of a folder by a file, has certainly ended."""
        text = f"process {self.process} on {self.host.rpartition('.')[0]}, which took the lock at {self.taken[:19]} UTC"
        if self.host != this_host():
            why = f"a run on another host or in a container holds the lock: {text}"
            remedy = f"make sure that it has, then delete {file}"
            raise BadRequest(f"{folder}: {why}; this host cannot see whether it has ended: {remedy}")
        start = start_of(int(self.process))
        if start is not None and (start == self.start or "" in (start, self.start)):
            ended = "" if start else f"; if it has ended, delete {file}"
            raise BadRequest(f"{folder}: {BUSY}: {text}; {REMEDY}{ended}")


def holder() -> Holder:
    """This process, as the holder of a lock from now on."""
    taken = datetime.now(UTC).replace(tzinfo=None).isoformat(" ", "microseconds")
    return Holder(this_host(), str(os.getpid()), start_of(os.getpid()) or "", taken)


def parse_holder(name: str) -> Holder | None:
    """The holder whose file has this name, or None if the name describes no holder."""
    with suppress(TypeError, ValueError):
        holder = Holder(**dict(parse_qsl(name, keep_blank_values=True)))
        int(holder.process)
        return holder
    return None


@cache
def this_host() -> str:
    """The name of this host with a hash that differs between hosts of this name, and between its containers."""
    marks = []
    with suppress(OSError):  # a system other than Linux
        marks = [os.readlink("/proc/self/ns/pid"), Path("/etc/machine-id").read_text(encoding="utf-8")]
    return f"{socket.gethostname()[:64]}.{sha256(''.join(marks).encode()).hexdigest()[:12]}"


def start_of(process: int) -> str | None:
    """The start time of a process; empty if the system does not provide it, `None` if the process has ended."""
    if sys.platform == "win32":
        return ""
    try:
        os.getpgid(process)
        if sys.platform != "linux":
            command, english = ["ps", "-o", "lstart=", "-p", str(process)], {"LC_ALL": "C", "TZ": "UTC"}
            return subprocess.run(command, env=os.environ | english, capture_output=True, text=True).stdout.strip()
        state, *fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8")
        return None if state in "ZX" else f"{boot[:8]}.{fields[18]}"
    except (ProcessLookupError, OverflowError):
        return None
    except OSError:  # the process of another user may be hidden
        return ""


@contextmanager
def hold_lock(folder: Path) -> Iterator[bool]:
    """Hold the lock of a processed folder, and yield whether it is held: a read-only folder needs none.

    The lock of a process that has ended is ignored.  Raises BadRequest if another process holds the lock, or one on
    another host may hold it.
    """
    if folder.is_dir() and not os.access(folder, os.W_OK):
        yield False
        return
    folder.mkdir(parents=True, exist_ok=True)
    file, me = folder / NAME, holder()
    for _ in range(MAX_TRIES):
        descriptor = _lock_by_system(file, me)
        if descriptor is not None or _lock_by_name(file, me):
            break
    else:
        raise BadRequest(f"{file} cannot be taken; if no other run is about to begin, delete it")
    try:
        yield True
    finally:
        if descriptor is not None:
            os.ftruncate(descriptor, 0)
            os.close(descriptor)
        else:
            (file / me.name).unlink(missing_ok=True)
            with suppress(OSError):  # another run may have replaced this empty folder
                file.rmdir()


def _lock_by_system(file: Path, me: Holder) -> int | None:
    """Lock a file by the system, and write its holder into it; `None` if the file system has no locks."""
    try:
        descriptor = os.open(file, OPEN_FLAGS, 0o666)
    except (IsADirectoryError, PermissionError) as error:  # Windows raises PermissionError for a folder
        if isinstance(error, PermissionError) and not file.is_dir():
            raise
        return None
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(descriptor, LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            os.lseek(descriptor, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.lseek(descriptor, 0, os.SEEK_SET)
        earlier = parse_holder(os.read(descriptor, 1000).decode("utf-8", "replace"))
        os.close(descriptor)
        if earlier:
            earlier.require_end(file.parent, file)
        if isinstance(error, BlockingIOError | PermissionError):
            raise BadRequest(f"{file.parent}: {BUSY}; {REMEDY}") from None
        with suppress(OSError):  # another run may have put a folder here
            file.unlink()
        return None
    with suppress(OSError):  # a full disk
        os.ftruncate(descriptor, 0)
        os.write(descriptor, me.name.encode())
    return descriptor


def _lock_by_name(file: Path, me: Holder) -> bool:
    """Lock by a folder with one file, named after its holder; return whether no other process was faster."""
    names: list[str] = []
    with suppress(OSError):
        names = sorted(os.listdir(file))
    for name in names:
        if name != me.name and (earlier := parse_holder(name)):
            earlier.require_end(file.parent, file / name)
    folder = file.with_name(f"{NAME}-{uuid4().hex}")
    try:
        if names:
            os.rename(file / names[0], file / me.name)
        else:
            with suppress(OSError):  # Windows does not replace an empty folder
                file.rmdir()
            folder.mkdir()
            (folder / me.name).touch()
            os.rename(folder, file)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        return False
    return True
