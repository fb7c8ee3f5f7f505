"""The datasets of an HDF5 file as arrays, read by h5py."""

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.arrays import ArrayLog, Named, matlab_object, take_in
from davinci_forces.logs.log import Log, Options

UNITS = ("units", "unit", "Units", "Unit")
CACHE = 64 << 20  # [bytes] of the chunks of a dataset that are kept unpacked, at most
PIECE = 1 << 16  # [bytes] of a packed chunk that are unpacked at once
SLOTS = 521  # that chunks share by their number, as HDF5 has it
MOST_REFERENCES = 1000
DEEPEST = 20


def opened(path: Path, options: Options) -> Log:
    """Open the file.

    Raises
    ------
    BadLog
        If it holds no dataset of samples.
    """
    file = h5py.File(path, "r", locking=False)
    log = ArrayLog(path, "hdf5", ())
    log.facts |= {name: text for name in file.attrs if (text := _text(file.attrs[name]))}
    take_in(log, list(arrays_of(file, log)))
    if not log.channels:
        raise BadLog(f"{path}: it holds no dataset of samples; it has {', '.join(file) or 'nothing'}")
    return log


def arrays_of(file: h5py.File, log: Log) -> Iterator[Named]:
    """Every dataset that groups lead to, in the order of their names; those in other files are left out."""
    names: list[bytes] = []

    def visit(name: bytes, about: Any) -> None:
        # What MATLAB refers to stands in /#refs#, and is followed from elsewhere.
        if about.type == h5py.h5o.TYPE_DATASET and not name.startswith(b"#"):
            names.append(name)

    h5py.h5o.visit(file.id, visit, info=True)  # which visits no link to another file
    for dataset in (file[name] for name in names):
        if dataset.is_virtual or dataset.external:
            log.warnings.append(f"dataset {dataset.name} lies in another file, and is left out")
            continue
        yield from _arrays(file, dataset, dataset.name.strip("/"), DEEPEST, log)


def _arrays(file: h5py.File, node: Any, name: str, deep: int, log: Log) -> Iterator[Named]:
    """The arrays of a dataset, or of what it refers to."""
    if isinstance(node, h5py.Group):
        for key in node if deep else ():
            yield from _arrays(file, node[key], f"{name}/{key}", deep - 1, log)
    elif "MATLAB_object_decode" in node.attrs:
        log.warnings.append(matlab_object(name, _matlab_class(node)))
    elif node.shape is None or "MATLAB_empty" in node.attrs:
        return
    elif _matlab_class(node) == "char" and node.dtype.kind == "u":
        log.facts[name] = "".join(map(chr, node[()].T.ravel()[:200].tolist()))
    elif h5py.check_ref_dtype(node.dtype) is h5py.Reference:
        pattern = "{}{{{}}}" if _matlab_class(node) == "cell" else "{}({})"
        for number, reference in enumerate(node[()].T.ravel()[:MOST_REFERENCES] if deep else (), start=1):
            if reference:
                yield from _arrays(file, file[reference], pattern.format(name, number), deep - 1, log)
    elif node.dtype.kind in "SO" and node.size == 1:
        log.facts[name] = _text(node[()])
    elif node.dtype.names:
        for part in node.dtype.names:
            if not node.dtype[part].shape:
                yield Named(f"{name}/{part}", Stored(file, node.ref, node.shape, node.dtype[part], part), unit_of(node))
    else:
        yield Named(name, Stored(file, node.ref, node.shape, node.dtype), unit_of(node))


def unit_of(dataset: h5py.Dataset) -> str:
    """The unit that an attribute gives, or ""."""
    return next((text for name in UNITS if (text := _text(dataset.attrs.get(name)))), "")


def _matlab_class(node: Any) -> str:
    return _text(node.attrs.get("MATLAB_class"))


def _text(value: Any) -> str:
    value = value.item() if isinstance(value, np.ndarray | np.generic) and value.size == 1 else value
    value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return value[:200] if isinstance(value, str) else ""


@dataclass(frozen=True)
class Stored:
    """A dataset, or a field of its records, that is open while it is read: thousands of open ones fill the memory."""

    file: h5py.File
    reference: h5py.Reference
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    of_record: str = ""
    opened: list[Any] = field(default_factory=list)

    def __getitem__(self, part: tuple[Any, ...]) -> Any:
        """A part of it; that with the last samples closes it."""
        axis = next((axis for axis, one in enumerate(part) if isinstance(one, slice) and one.stop is not None), -1)
        if not self.opened:
            self.opened.append(_opened(self.file, self.reference, axis))
        values = self.opened[0][(self.of_record, *part) if self.of_record else part]
        if axis < 0 or part[axis].stop == self.shape[axis]:
            self.opened.clear()
        return values


def _opened(file: h5py.File, reference: h5py.Reference, axis: int) -> Any:
    """A dataset with room for those of its chunks that hold the same samples; or one that is unpacked in order.

    So a chunk is unpacked once, and not for every slice of it, but for a large one that is shuffled, too: to keep it
    while the next one is unpacked takes more memory than there is.
    """
    node = file[reference]
    if node.chunks is None or not node.size or axis < 0:
        return node
    chunks = [-(-length // chunk) for length, chunk in zip(node.shape, node.chunks, strict=True)]
    one = math.prod(node.chunks) * node.dtype.itemsize
    if one > CACHE and node.id.get_num_chunks() == chunks[axis] == math.prod(chunks) and _is_plain(node, axis):
        return Unpacked(node, axis)
    room = min(math.prod(chunks) // chunks[axis] * one, CACHE)
    del node  # as long as a dataset is open, it keeps the room that it was opened with
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(SLOTS, room, 1.0)  # those that were read to their end make room first
    return h5py.Dataset(h5py.h5r.dereference(reference, file.id, access))


def _is_plain(node: h5py.Dataset, axis: int) -> bool:
    """Whether its chunks are numbers packed by gzip alone, sample after sample along an axis."""
    filters, stored = node.id.get_create_plist(), node.id.get_type()
    is_gzip = filters.get_nfilters() == 1 and filters.get_filter(0)[0] == h5py.h5z.FILTER_DEFLATE
    in_order = max(node.chunks[:axis], default=1) == 1 and node.chunks[axis + 1 :] == node.shape[axis + 1 :]
    return is_gzip and in_order and node.dtype.kind in "iuf" and bool(stored.equal(h5py.h5t.py_create(node.dtype)))


class Unpacked:
    """A dataset whose chunks are too large to be kept, unpacked piece by piece as its samples are asked for."""

    def __init__(self, dataset: h5py.Dataset, axis: int) -> None:
        self.dataset, self.axis = dataset, axis
        self.width = math.prod(dataset.shape[axis + 1 :]) * dataset.dtype.itemsize
        self.start()

    def start(self) -> None:
        """Go back to the first sample."""
        self.at, self.waiting, self.pieces = 0, bytearray(), self.unpacked()

    def unpacked(self) -> Iterator[bytes]:
        """The samples of each chunk, piece by piece."""
        length, step = self.dataset.shape[self.axis], self.dataset.chunks[self.axis]
        for first in range(0, length, step):
            place = tuple(first if axis == self.axis else 0 for axis in range(self.dataset.ndim))
            unfiltered, packed = self.dataset.id.read_direct_chunk(place)
            stream, left = zlib.decompressobj(), min(step, length - first) * self.width
            for at in range(0, len(packed), PIECE):
                piece = packed[at : at + PIECE] if unfiltered else stream.decompress(packed[at : at + PIECE])
                yield piece[:left]
                left -= len(piece[:left])
            if left:
                raise OSError(f"a chunk of {self.dataset.name} ends early")

    def __getitem__(self, part: tuple[Any, ...]) -> Any:
        """A part of it; what is before the samples that were read last is unpacked anew."""
        first, last, _ = part[self.axis].indices(self.dataset.shape[self.axis])
        if first * self.width < self.at:
            self.start()
        while self.at + len(self.waiting) < last * self.width:
            self.waiting += next(self.pieces)
        begin, end = first * self.width - self.at, last * self.width - self.at
        values = np.frombuffer(bytes(self.waiting[begin:end]), self.dataset.dtype)
        del self.waiting[:end]
        self.at += end
        values = values.reshape([1] * self.axis + [last - first, *self.dataset.shape[self.axis + 1 :]])
        return values[tuple(slice(None) if axis == self.axis else one for axis, one in enumerate(part))]
