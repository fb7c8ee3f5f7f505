"""The one door to files that users, instruments and earlier runs leave: read and written here, and shown as text.

Regular files are read, and links to them.  A pipe or a device would keep a run waiting, or never end.
"""

import hashlib
import os
import re
import stat
from collections.abc import Callable, Mapping
from io import BufferedReader, BytesIO, TextIOWrapper
from pathlib import Path
from uuid import uuid4

from davinci_forces.errors import NotAFile

# Bytes at most of what a run writes to be read whole.  A log takes 70 kB of results.json, and as much of the ledger's
# index: these are fifteen thousand logs, more than a study.toml has room for.
LARGEST = 1 << 30
PIECE = 1 << 18  # [bytes] of a file that are read at a time
PARTIAL = ".partial"  # what the name of a file that is still being written ends with
# A pipe without a writer, or a line without a modem, opens at once; no terminal takes hold of the process.
AT_ONCE = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
KINDS = {"p": "a pipe", "s": "a socket", "d": "a folder"}  # by the first letter of a mode; what is left is a device
# What a terminal or a page would obey or hide instead of showing it, and what no text in UTF-8 holds.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")


def open_file(file: Path | str) -> BufferedReader:
    """Open a regular file to be read; raises as `require_file` does."""
    return open(file, "rb", opener=_opener)


def _opener(file: str, flags: int) -> int:
    try:
        number = os.open(file, flags | AT_ONCE)
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
    """Refuse what is no regular file, before a library is given its path.

    Raises
    ------
    NotAFile
        If it is a pipe, a device, a socket or a folder.
    """
    if not stat.S_ISREG(mode := os.stat(file).st_mode):
        what = KINDS.get(stat.filemode(mode)[0], "a device")
        raise NotAFile(0, f"it is {what}, not a file; remove it, or put the file in its place", name or str(file))


def read_bytes(file: Path | str, most: int = LARGEST, beyond: str = "more than is read whole") -> bytes:
    """The content of a regular file, of at most so many bytes; `beyond` is said of one that has more.

    Raises
    ------
    NotAFile
        If it is none, or has more, whatever its size is said to be: that of a file of /proc is 0.
    """
    with open(file, "rb", buffering=0, opener=_opener) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = stream.read(size + 1) if size <= most else b""
        while content and len(content) <= most and (piece := stream.read(PIECE)):
            content += piece
    if max(size, len(content)) > most:
        raise NotAFile(0, f"it has {max(size, len(content)) / 1e6:.1f} MB, {beyond}", str(file))
    return content


def text_of(content: bytes, encoding: str = "utf-8", errors: str = "strict") -> str:
    """The text of a file, its lines ending in LF; raises ValueError where its encoding is another."""
    return TextIOWrapper(BytesIO(content), encoding, errors).read()


def digest(file: Path | str) -> str:
    """The sha256 of a regular file's bytes; raises as `open_file` does."""
    sha256 = hashlib.sha256()
    with open(file, "rb", buffering=0, opener=_opener) as stream:  # less work than `hashlib.file_digest` of a small one
        while piece := stream.read(PIECE):
            sha256.update(piece)
    return sha256.hexdigest()


def write_bytes(file: Path, content: bytes) -> None:
    """Write a file so that it is there whole or not at all; a pipe in its place is replaced."""
    write_together({file: content})


def write_together(contents: Mapping[Path, bytes]) -> None:
    """Write files that belong together: all are whole before the first gets its name, the last one's name says so."""
    name = unnamed()
    try:
        for file, content in contents.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            name(file).write_bytes(content)
        for file in contents:
            name(file).replace(file)
    finally:
        for file in contents:
            name(file).unlink(missing_ok=True)


def unnamed() -> Callable[[Path], Path]:
    """What files are called while they are written: of two processes that write one file, neither has the other's."""
    token = uuid4().hex[:12]
    return lambda file: file.with_name(f"{file.name}.{token}{PARTIAL}")


def visible(text: str, keep: str = "") -> str:
    """Text or the name of a file, its control characters and marks of direction written out: `\\x1b`, `\\u202e`."""

    def escaped(match: re.Match[str]) -> str:
        code = ord(match[0])  # beyond the first as JSON and TOML have them
        return match[0] if match[0] in keep else f"\\x{code:02x}" if code < 32 else f"\\u{code:04x}"

    return CONTROL.sub(escaped, text)
