"""Read and write all files of users, instruments and earlier runs, and make text safe to show.

Only regular files and links to them are read: a pipe or a device would keep a run waiting, or never end.
"""

import hashlib
import os
import re
import shutil
import stat
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from io import BufferedReader, BytesIO, TextIOWrapper
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from uuid import uuid4

from davinci_forces.errors import BadRequest, NotAFile

# Size of files that a run writes.  Each log takes 70 kB of results.json: this is enough for fifteen thousand logs, more
# than a study.toml has room for.
MAX_BYTES = 1 << 30
BLOCK_BYTES = 1 << 18  # bytes that are read at a time
PARTIAL = ".partial"  # ends the name of a file that is still being written
# Open a pipe without a writer, or a line without a modem, without waiting; let no terminal control the process.
NO_WAIT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
KINDS = {"p": "a pipe", "s": "a socket", "d": "a folder"}  # by the first letter of a mode; any other is a device
# Characters that a terminal or a page would interpret or hide, and characters that UTF-8 cannot encode.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")


def open_file(file: Path | str) -> BufferedReader:
    """Open a regular file for reading; raises as `require_file` does."""
    return open(file, "rb", opener=_opener)


def _opener(file: str, flags: int) -> int:
    try:
        number = os.open(file, flags | NO_WAIT)
    except OSError:
        require_file(file)  # a socket cannot be opened, and neither can a folder on Windows
        raise
    try:
        require_file(number, file)
    except NotAFile:
        os.close(number)
        raise
    return number


def require_file(file: Path | str | int, name: str = "") -> None:
    """Check that a path is a regular file, before a library opens it.

    Raises NotAFile if it is a pipe, a device, a socket or a folder.
    """
    if not stat.S_ISREG(mode := os.stat(file).st_mode):
        what = KINDS.get(stat.filemode(mode)[0], "a device")
        raise NotAFile(0, f"it is {what}, not a file; remove it, or put the file in its place", name or str(file))


def read_bytes(file: Path | str, most: int = MAX_BYTES, beyond: str = "more than is read whole") -> bytes:
    """Read a regular file of at most `most` bytes; `beyond` ends the message about a larger one.

    Raises NotAFile if it is not a regular file, or has more bytes, whatever size the system states: 0 for a file of
    /proc.
    """
    with open(file, "rb", buffering=0, opener=_opener) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = stream.read(size + 1) if size <= most else b""
        while content and len(content) <= most and (block := stream.read(BLOCK_BYTES)):
            content += block
    if max(size, len(content)) > most:
        raise NotAFile(0, f"it has {max(size, len(content)) / 1e6:.1f} MB, {beyond}", str(file))
    return content


def text_of(content: bytes, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Decode the content of a file, with LF as the end of lines; raises ValueError if its encoding is another."""
    return TextIOWrapper(BytesIO(content), encoding, errors).read()


def digest(file: Path | str) -> str:
    """The sha256 of a regular file's bytes; raises as `open_file` does."""
    sha256 = hashlib.sha256()
    with open(file, "rb", buffering=0, opener=_opener) as stream:  # faster than `hashlib.file_digest` for small files
        while block := stream.read(BLOCK_BYTES):
            sha256.update(block)
    return sha256.hexdigest()


def write_bytes(file: Path, content: bytes) -> None:
    """Write a file completely or not at all; a pipe in its place is replaced."""
    write_together({file: content})


def write_together(contents: Mapping[Path, bytes]) -> None:
    """Write files that belong together: all are complete before the first gets its name, so the last name proves it."""
    name = temporary_name()
    try:
        for file, content in contents.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            name(file).write_bytes(content)
        for file in contents:
            name(file).replace(file)
    finally:
        for file in contents:
            name(file).unlink(missing_ok=True)


def write_folder(folder: Path, contents: Mapping[str, bytes], replaces: bool = False) -> None:
    """Write a folder of files, by name, completely or not at all.

    Raises NotAFile if the folder exists and is not to be replaced, or holds anything but files of these names.
    """
    partial, before = temporary_name()(folder), temporary_name()(folder)
    try:
        write_together({partial / name: content for name, content in contents.items()})
        if os.path.lexists(folder):
            names = [folder.name]
            if folder.is_dir() and not folder.is_symlink():
                names = [path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()]
            foreign = [name for name in names if name not in contents or not (folder / name).is_file()]
            if foreign or not replaces:
                what = f"it exists, and holds {(foreign or names)[0]!r}"
                raise NotAFile(0, f"{what}; delete that, or name another folder", str(folder))
            folder.rename(before)
        partial.rename(folder)
    finally:
        if before.exists() and not folder.exists():
            before.rename(folder)
        for remnant in (partial, before):
            shutil.rmtree(remnant, ignore_errors=True)


def temporary_name() -> Callable[[Path], Path]:
    """A function that gives the temporary name of a file; two processes that write one file use different names."""
    token = uuid4().hex[:12]
    return lambda file: file.with_name(f"{file.name}.{token}{PARTIAL}")


def visible(text: str, keep: str = "") -> str:
    """Text with control characters and direction marks escaped, except those of `keep`: `\\x1b`, `\\u202e`."""

    def escape(match: re.Match[str]) -> str:
        code = ord(match[0])  # from 32 on as in JSON and TOML
        return match[0] if match[0] in keep else f"\\x{code:02x}" if code < 32 else f"\\u{code:04x}"

    return CONTROL.sub(escape, text)


def table(rows: Sequence[Sequence[str]], right_from: int = sys.maxsize) -> Iterator[str]:
    """Lay out the rows of a table as lines; columns from a number on, from 0, are aligned right."""
    widths = [max(map(len, column)) for column in zip_longest(*rows, fillvalue="")]
    for row in rows:
        cells = (f"{cell:{'>' if i >= right_from else '<'}{widths[i]}}" for i, cell in enumerate(row))
        yield "  ".join(cells).rstrip()


def json_number(value: float) -> float | None:
    """Return the number, or None for NaN and infinity, which JSON does not have."""
    return value if isfinite(value) else None


def leftovers(folder: Path) -> Iterator[Path]:
    """Yield the incomplete files of an interrupted run.

    Raises BadRequest if a folder in it is a link, through which a run would write elsewhere.
    """
    for home, folders, files in os.walk(folder):  # takes a third of the time of rglob
        for name in folders:
            if os.path.islink(link := os.path.join(home, name)):
                why = f"{link} is a link to {os.readlink(link)}, and a run writes no results through links"
                raise BadRequest(f"{why}; remove it, or choose other folders with --processed and --reports")
        yield from (Path(home, file) for file in files if file.endswith(PARTIAL))
