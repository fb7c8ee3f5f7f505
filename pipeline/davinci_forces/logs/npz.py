"""NumPy's files, read piece by piece and without pickle: an array (.npy), or several arrays by name (.npz)."""

import math
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs import isolated
from davinci_forces.logs.arrays import ArrayLog, NamedArray, take_in
from davinci_forces.logs.log import Log
from davinci_forces.maths.arrays import Array

MAX_MEMBERS = 1000
read = partial(isolated.read, reader=__name__)


def recognises(path: Path, head: bytes) -> bool:
    """Whether it begins as an array, or is a zip file whose first member is one."""
    return head.startswith(npy.MAGIC_PREFIX) or (head.startswith(b"PK") and b".npy" in head[30:542])


def open_in_child(path: Path) -> Log:
    """Open the file; raises BadLog if it holds no array of samples, or more than `MAX_MEMBERS`."""
    log = ArrayLog(path, "npz", ())
    with open_file(path) as file:
        is_zip = file.read(2) == b"PK"
    names = [""]
    if is_zip:
        with zipfile.ZipFile(path) as archive:
            names = [info.filename for info in archive.infolist() if info.filename.endswith(".npy")]
    if len(names) > MAX_MEMBERS:
        raise BadLog(f"{path}: it holds {len(names)} arrays; a log has at most {MAX_MEMBERS}")
    take_in(log, [array for name in names for array in _arrays(path, name, log)])
    if not log.channels:
        why = "; ".join(log.warnings) or ", ".join(log.facts) or "nothing"
        raise BadLog(f"{path}: it holds no array of samples; it has {why}")
    return log


def _arrays(path: Path, member: str, log: Log) -> Iterator[NamedArray]:
    """List an array, or the fields of an array of records; objects are Python's and are never loaded."""
    name = member.removesuffix(".npy") or path.stem
    with _opened(path, member) as file:
        shape, by_column, dtype = _header(file)
    if dtype.hasobject:
        why = "which could run any code when they are loaded, and is left out"
        remedy = "save its numbers as arrays of their own: numpy.savez(file, t=..., q=...)"
        log.warnings.append(f"{name} holds Python objects, {why}; {remedy}")
    elif dtype.names:
        for part in dtype.names:
            if not dtype[part].shape and not dtype[part].names:
                yield NamedArray(f"{name}/{part}", Member(path, member, shape, dtype[part], by_column, part))
    elif dtype.kind in "mM":
        log.warnings.append(f"{name} holds times of type {dtype}, and is left out; save them as seconds")
    elif math.prod(shape):
        yield NamedArray(name, Member(path, member, shape, dtype, by_column))


def _opened(path: Path, member: str) -> IO[bytes]:
    if not member:
        return open_file(path)
    return zipfile.ZipFile(path).open(member)  # closing the member closes the file


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    return read(file)


@dataclass
class Member:
    """An array of a file, of which the samples are read in order; `of_record` is a field of its records."""

    path: Path
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    by_column: bool  # stored column after column
    of_record: str = ""

    def __getitem__(self, part: tuple[Any, ...]) -> Array:
        """Read a part of it; columns are read as a whole."""
        if self.by_column or not (part and isinstance(part[0], slice) and part[0].stop is not None):
            return np.asarray(self._whole[part])
        first, last, _ = part[0].indices(self.shape[0])
        return np.asarray(self._samples(first, last)[(slice(None), *part[1:])])

    @cached_property
    def _whole(self) -> Array:
        return self._samples(0, self.shape[0] if self.shape else 1)

    @cached_property
    def _opened(self) -> tuple[IO[bytes], np.dtype[Any], int]:
        """The file, the type of its elements, and where they begin."""
        file = _opened(self.path, self.name)
        return file, _header(file)[2], file.tell()

    def _samples(self, first: int, last: int) -> Array:
        file, stored, begin = self._opened
        width = math.prod(self.shape[1:]) * stored.itemsize
        file.seek(begin + first * width)
        content = file.read(count := (last - first) * width)
        if len(content) < count:
            raise ValueError(f"an array ends after {len(content)} of {count} bytes")
        shape = (last - first, *self.shape[1:])[: len(self.shape)]
        values = np.frombuffer(content, stored).reshape(shape, order="F" if self.by_column else "C")
        return values[self.of_record] if self.of_record else values
