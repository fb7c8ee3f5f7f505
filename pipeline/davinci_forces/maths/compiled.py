"""Compile loops that numpy cannot express.  No fastmath: a result must not depend on the compiler's optimisations.

Numba recompiles a function when its own file changes, but not when a function that it inlines does.  The folder of
compiled code is named by a hash of all sources.  To load compiled code is to run it: only the user may write there.
"""

import atexit
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

PACKAGE = Path(__file__).parents[1]
SOURCES = ("maths", "filters", "haptics/maths")  # folders that compiled code depends on
NAME = re.compile("compiled-[0-9a-f]{32}")
MAX_UNUSED = 30 * 86400.0  # [s]
MIN_FOLDERS = 5  # number of folders that are never removed

F = TypeVar("F", bound=Callable[..., object])
_setting = Lock()


def compile_function(function: F, **options: Any) -> F:
    """Compile a function at its first call, in every process again."""
    from numba import njit

    compiled: F = njit(no_cfunc_wrapper=True, **options)(function)
    return compiled


def inline(function: F) -> F:
    """Compile a function into every compiled function that calls it."""
    return compile_function(function, inline="always")


def compile_and_store(function: F) -> F:
    """Compile a function once, and store the code on disk."""
    from numba import config

    with _setting:  # threads may import several modules at once
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder())
        try:
            return compile_function(function, cache=True, error_model="numpy")
        finally:
            config.CACHE_DIR = before


@cache
def folder() -> Path:
    """The folder of numba's code for these sources; folders of other sources are removed after `MAX_UNUSED`."""
    digest = sha256(f"{sys.version} {version('numba')} {version('llvmlite')}".encode())
    for file in sorted(file for source in SOURCES for file in PACKAGE.joinpath(source).rglob("*.py")):
        digest.update(f"\n{file.relative_to(PACKAGE).as_posix()} {sha256(file.read_bytes()).hexdigest()}".encode())
    name = f"compiled-{digest.hexdigest()[:32]}"
    try:
        place = private(home() / name)
        os.utime(place)  # records its last use
        place.chmod(0o700)
    except OSError:
        place = private(temporary() / name)
    with suppress(OSError):  # another process may remove the same folders
        remove_unused(place.parent)
    return place


@cache
def home() -> Path:
    """The folder of all compiled code: in NUMBA_CACHE_DIR if that is set, else in the user's cache folder.

    Without such a folder, or if others could write to it, a temporary folder is shared with later child processes.
    """
    user, chosen = os.environ.get("HOME", ""), os.environ.get("NUMBA_CACHE_DIR")
    linux = os.environ.get("XDG_CACHE_HOME") or os.path.join(user, ".cache")
    others = {"win32": os.environ.get("LOCALAPPDATA", ""), "darwin": os.path.join(user, "Library", "Caches")}
    base = Path(others.get(sys.platform, linux))
    with suppress(OSError):
        if chosen:
            return private(Path(chosen, "davinci-forces").absolute(), parents=True)
        if base.is_absolute():
            return private(private(base.resolve()) / "davinci-forces")
    return temporary()


@cache
def temporary() -> Path:
    """A folder for this process and its later child processes, removed when this process ends."""
    place = os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="davinci-forces-")
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    return private(Path(place, "davinci-forces"))


def private(place: Path, parents: bool = False) -> Path:
    """Create the folder; raises PermissionError if it is a link, or another user owns it or may write to it."""
    place.mkdir(mode=0o700, parents=parents, exist_ok=True)
    status = place.lstat()
    is_private = os.name == "nt" or (status.st_uid == os.geteuid() and not status.st_mode & 0o022)
    if not (stat.S_ISDIR(status.st_mode) and is_private):
        raise PermissionError(f"{place} is no folder to which this user alone may write")
    return place


def remove_unused(place: Path) -> None:
    """Remove folders that no process has used for `MAX_UNUSED`, except for the last `MIN_FOLDERS`."""
    folders = (path for path in place.iterdir() if NAME.fullmatch(path.name) and not path.is_symlink())
    for path in sorted(folders, key=lambda path: path.stat().st_mtime)[:-MIN_FOLDERS]:
        if path.stat().st_mtime < time.time() - MAX_UNUSED:
            shutil.rmtree(private(path), ignore_errors=True)
