"""Read the complete lines of a text log in blocks of bytes, for any encoding, line end and damage at the end."""

import codecs
import re
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file

BLOCK_BYTES = 4 << 20  # [bytes] of a block
MAX_LINE = 64 << 20  # [bytes] of a line
GZIP = b"\x1f\x8b"
CR, LF = 13, 10
MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


class Block(NamedTuple):
    """Complete lines: the number of the first, counted from 1; their bytes; and their count."""

    first: int
    text: bytes
    lines: int

    def halves(self) -> "tuple[Block, Block]":
        """Split a block of at least two lines into two of about equal size."""
        middle = self.text.find(b"\n", len(self.text) // 2, len(self.text) - 1) + 1
        middle = middle or self.text.rfind(b"\n", 0, len(self.text) // 2) + 1
        upper = self.text[:middle]
        lines = upper.count(b"\n")
        return Block(self.first, upper, lines), Block(self.first + lines, self.text[middle:], self.lines - lines)


@dataclass
class Lines:
    """The lines of a text file, plain or gzipped.  `cut`, `padding` and `damage` are known when `blocks` has ended.

    Every line of a block ends in LF or CRLF.  UTF-16 becomes UTF-8; every other encoding is left as it is, because
    numbers and delimiters are ASCII in all of them.
    """

    path: Path
    encoding: str | None = None
    cut: bytes = b""  # the last line, if the file ends within this line
    cut_at: int = 0  # number of that line, counted from 1
    padding: int = 0  # NUL bytes at the end, as a power cut leaves them
    damage: str = ""  # why a compressed file could not be read to its end

    def __post_init__(self) -> None:
        with open_file(self.path) as file:
            start = file.read(4)
        self.zipped = start.startswith(GZIP)
        self.mark = next((mark for mark in MARKS if start.startswith(mark)), b"")
        self.read_as = self.encoding or MARKS.get(self.mark, "")
        try:
            codecs.lookup(self.read_as or "ascii")
        except LookupError:
            raise BadLog(f"{self.path}: there is no encoding {self.encoding!r}; correct it in study.toml") from None

    def head(self, size: int = 1 << 18) -> bytes:
        """Return the first complete lines, about `size` bytes, or the only line if it has no end."""
        for block in self.blocks(size):
            return block.text
        return self.cut

    def blocks(self, size: int = BLOCK_BYTES) -> Iterator[Block]:
        """Read the blocks of the file, in order."""
        self.cut, self.padding, self.damage = b"", 0, ""
        remainder, line = b"", 1
        for piece in self._without_padding(self._decoded(self._bytes(size))):
            end = _last_end(piece)
            if not end:
                piece, remainder = remainder + piece, b""
                end = _last_end(piece)
            block = _block(line, b"".join((remainder, memoryview(piece)[:end])) if end else b"")
            remainder = piece[end:]
            if len(remainder) > MAX_LINE:
                raise BadLog(f"{self.path}:{line}: a line longer than {MAX_LINE} bytes; the file is not a text log")
            if block.text:
                yield block
                line += block.lines
        if remainder.endswith(b"\r"):
            block, remainder = _block(line, remainder), b""
            yield block
            line += block.lines
        self.cut, self.cut_at = remainder, line

    def remarks(self) -> list[str]:
        """Say what is wrong with the end of the file, once `blocks` has ended."""
        nuls = f"{self.padding} NUL bytes at the end of the file, typical of a power cut, are not read"
        return [nuls] * bool(self.padding) + [self.damage] * bool(self.damage)

    def _bytes(self, size: int) -> Iterator[bytes]:
        with open_file(self.path) as file:
            pieces = iter(lambda: file.read(size), b"")
            yield from self._unzipped(pieces, size) if self.zipped else pieces

    def _unzipped(self, pieces: Iterable[bytes], size: int) -> Iterator[bytes]:
        """Unzip a gzip file up to any damage; `gzip.open` would lose the bytes before the damage."""
        unpack, has_begun = zlib.decompressobj(wbits=31), False
        for piece in pieces:
            while piece:
                has_begun = True
                try:
                    text = unpack.decompress(piece, size)
                except zlib.error as error:
                    self.damage = f"the compressed file is damaged ({error}); the data before the damage was read"
                    return
                if text:
                    yield text
                piece = unpack.unconsumed_tail
                if unpack.eof:
                    piece = unpack.unused_data.lstrip(b"\0")
                    unpack, has_begun = zlib.decompressobj(wbits=31), False
        if has_begun:
            self.damage = "the compressed file is cut; the data before the cut was read"

    def _decoded(self, pieces: Iterable[bytes]) -> Iterator[bytes]:
        wide = "16" in self.read_as or "32" in self.read_as
        decoder = codecs.getincrementaldecoder(self.read_as)("replace") if wide else None
        mark = b"" if wide else self.mark
        for piece in pieces:
            yield decoder.decode(piece).encode() if decoder else piece.removeprefix(mark)
            mark = b""
        if decoder:
            yield decoder.decode(b"", final=True).encode()

    def _without_padding(self, pieces: Iterable[bytes]) -> Iterator[bytes]:
        padding = 0  # NUL bytes that are padding unless something follows them
        for piece in pieces:
            solid = piece.rstrip(b"\0")
            if solid and padding:
                yield b"\0" * padding
                padding = 0
            padding += len(piece) - len(solid)
            if solid:
                yield solid
        self.padding = padding


def _last_end(text: bytes) -> int:
    """End of the last complete line, or 0.  A CR at the very end waits: its LF may come in the next piece."""
    end = text.rfind(b"\n")
    return (end if end >= 0 else text.rfind(b"\r", 0, len(text) - 1)) + 1


def _block(first: int, text: bytes) -> Block:
    """Make a block of these lines: a single CR ends a line, and so do several before one LF."""
    octets = np.frombuffer(text, np.uint8)
    returns, lines = int(np.count_nonzero(octets == CR)), int(np.count_nonzero(octets == LF))
    if returns not in (0, lines):
        text = re.sub(rb"\r+\n", b"\n", text).replace(b"\r", b"\n")
        lines = text.count(b"\n")
    return Block(first, text, lines)


def decode(text: bytes, encoding: str | None = None) -> str:
    """Decode text of a log: as UTF-8 if valid, else in the code page of western Windows."""
    for name in (encoding,) if encoding else ("utf-8", "cp1252", "latin-1"):
        try:
            return text.decode(name)
        except UnicodeDecodeError:
            continue
    return text.decode(encoding or "latin-1", "replace")
