"""Read the datasets of an HDF5 file as arrays, with h5py."""

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.arrays import MAX_DEPTH, ArrayLog, NamedArray, matlab_object, take_in
from davinci_forces.logs.log import Log

UNIT_ATTRIBUTES = ("units", "unit", "Units", "Unit")
CACHE = 64 << 20  # [bytes] of unpacked chunks kept per dataset, at most
UNPACK_BYTES = 1 << 16  # [bytes] of a packed chunk unpacked at once
SLOTS = 521  # of HDF5's chunk cache, HDF5's default
MAX_REFERENCES = 1000


def open_in_child(path: Path) -> Log:
    """Open the file; raises BadLog if it holds no dataset of samples."""
    file = h5py.File(path, "r", locking=False)
    log = ArrayLog(path, "hdf5", ())
    log.facts |= {name: text for name in file.attrs if (text := _text(file.attrs[name]))}
    take_in(log, list(arrays_of(file, log)))
    if not log.channels:
        raise BadLog(f"{path}: it holds no dataset of samples; it has {', '.join(file) or 'nothing'}")
    return log


def arrays_of(file: h5py.File, log: Log) -> Iterator[NamedArray]:
    """List all datasets in the groups, in the order of names; datasets in other files are left out."""
    names: list[bytes] = []

    def visit(name: bytes, about: Any) -> None:
        # MATLAB stores referenced data in /#refs#; they are read through the references.
        if about.type == h5py.h5o.TYPE_DATASET and not name.startswith(b"#"):
            names.append(name)

    h5py.h5o.visit(file.id, visit, info=True)  # follows no link to another file
    for dataset in (file[name] for name in names):
        if dataset.is_virtual or dataset.external:
            log.warnings.append(f"dataset {dataset.name} is stored in another file and is left out")
            continue
        yield from _arrays(file, dataset, dataset.name.strip("/"), MAX_DEPTH, log)


def _arrays(file: h5py.File, node: Any, name: str, deep: int, log: Log) -> Iterator[NamedArray]:
    """List the arrays of a dataset and of the datasets that it refers to."""
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
        references = np.asarray(node[()], object).T.ravel()[:MAX_REFERENCES]  # a scalar is no array
        for number, reference in enumerate(references if deep else (), start=1):
            if reference:
                yield from _arrays(file, file[reference], pattern.format(name, number), deep - 1, log)
    elif node.dtype.kind in "SO" and node.size == 1:
        log.facts[name] = _text(node[()])
    elif node.dtype.names:
        for part in node.dtype.names:
            if not node.dtype[part].shape:
                column = Stored(file, node.ref, node.shape, node.dtype[part], part)
                yield NamedArray(f"{name}/{part}", column, unit_of(node))
    else:
        yield NamedArray(name, Stored(file, node.ref, node.shape, node.dtype), unit_of(node))


def unit_of(dataset: h5py.Dataset) -> str:
    """Return the unit stated by an attribute, or ""."""
    return next((text for name in UNIT_ATTRIBUTES if (text := _text(dataset.attrs.get(name)))), "")


def _matlab_class(node: Any) -> str:
    return _text(node.attrs.get("MATLAB_class"))


def _text(value: Any) -> str:
    value = value.item() if isinstance(value, np.ndarray | np.generic) and value.size == 1 else value
    value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return value[:200] if isinstance(value, str) else ""


@dataclass(frozen=True)
class Stored:
    """A dataset, or a field of its records, open only while it is read: thousands of open ones fill the memory."""

    file: h5py.File
    reference: h5py.Reference
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    of_record: str = ""
    opened: list[Any] = field(default_factory=list)

    def __getitem__(self, part: tuple[Any, ...]) -> Any:
        """Read a part of it; reading the last samples closes it."""
        axis = next((axis for axis, cut in enumerate(part) if isinstance(cut, slice) and cut.stop is not None), -1)
        if not self.opened:
            self.opened.append(_opened(self.file, self.reference, axis))
        values = self.opened[0][(self.of_record, *part) if self.of_record else part]
        if axis < 0 or part[axis].stop == self.shape[axis]:
            self.opened.clear()
        return values


def _opened(file: h5py.File, reference: h5py.Reference, axis: int) -> Any:
    """Open a dataset with a cache for the chunks that hold the same samples, or one that is unpacked in order.

    Each chunk is then unpacked once instead of once per slice.  Large shuffled chunks are the exception: keeping one
    while the next is unpacked takes too much memory.
    """
    node = file[reference]
    if node.chunks is None or not node.size or axis < 0:
        return node
    chunks = [-(-length // chunk) for length, chunk in zip(node.shape, node.chunks, strict=True)]
    chunk_bytes = math.prod(node.chunks) * node.dtype.itemsize
    if chunk_bytes > CACHE and node.id.get_num_chunks() == chunks[axis] == math.prod(chunks) and _is_plain(node, axis):
        return Unpacked(node, axis)
    room = min(math.prod(chunks) // chunks[axis] * chunk_bytes, CACHE)
    del node  # an open dataset keeps the cache that it was opened with
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(SLOTS, room, 1.0)  # chunks read to their end are evicted first
    return h5py.Dataset(h5py.h5r.dereference(reference, file.id, access))


def _is_plain(node: h5py.Dataset, axis: int) -> bool:
    """Whether its chunks are numbers, packed by gzip alone, sample after sample along an axis."""
    filters, stored = node.id.get_create_plist(), node.id.get_type()
    is_gzip = filters.get_nfilters() == 1 and filters.get_filter(0)[0] == h5py.h5z.FILTER_DEFLATE
    in_order = max(node.chunks[:axis], default=1) == 1 and node.chunks[axis + 1 :] == node.shape[axis + 1 :]
    return is_gzip and in_order and node.dtype.kind in "iuf" and bool(stored.equal(h5py.h5t.py_create(node.dtype)))


class Unpacked:
    """A dataset whose chunks are too large to be kept, unpacked piece by piece as its samples are read."""

    def __init__(self, dataset: h5py.Dataset, axis: int) -> None:
        self.dataset, self.axis = dataset, axis
        self.width = math.prod(dataset.shape[axis + 1 :]) * dataset.dtype.itemsize
        self.start()

    def start(self) -> None:
        """Go back to the first sample."""
        self.at, self.waiting, self.pieces = 0, bytearray(), self.unpack()

    def unpack(self) -> Iterator[bytes]:
        """Unpack the samples of each chunk, piece by piece."""
        length, step = self.dataset.shape[self.axis], self.dataset.chunks[self.axis]
        for first in range(0, length, step):
            place = tuple(first if axis == self.axis else 0 for axis in range(self.dataset.ndim))
            unfiltered, packed = self.dataset.id.read_direct_chunk(place)
            stream, remaining = zlib.decompressobj(), min(step, length - first) * self.width
            for at in range(0, len(packed), UNPACK_BYTES):
                piece = packed[at : at + UNPACK_BYTES]
                piece = piece if unfiltered else stream.decompress(piece)
                yield piece[:remaining]
                remaining -= len(piece[:remaining])
            if remaining:
                raise OSError(f"a chunk of {self.dataset.name} ends early")

    def __getitem__(self, part: tuple[Any, ...]) -> Any:
        """Read a part of it; samples before those read last are unpacked again."""
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
        return values[tuple(slice(None) if axis == self.axis else cut for axis, cut in enumerate(part))]
