"""The datasets of an HDF5 file as arrays, read by h5py."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.arrays import ArrayLog, Named, matlab_object, take_in
from davinci_forces.logs.log import Log, Options

UNITS = ("units", "unit", "Units", "Unit")
CACHE = 64 << 20  # [bytes] of the chunks of a dataset that are kept unpacked, at most
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
    names: list[str] = []
    # Which visits no link to another file.
    file.visititems(lambda name, each: names.append(name) if isinstance(each, h5py.Dataset) else None)
    for dataset in (_opened(file, name) for name in names):
        if dataset.name.startswith("/#"):  # what MATLAB refers to, and follows from elsewhere
            continue
        if dataset.is_virtual or dataset.external:
            log.warnings.append(f"dataset {dataset.name} lies in another file, and is left out")
            continue
        yield from _arrays(file, dataset, dataset.name.strip("/"), DEEPEST, log)


def _arrays(file: h5py.File, node: Any, name: str, deep: int, log: Log) -> Iterator[Named]:
    """The arrays of a dataset, or of what it refers to."""
    if isinstance(node, h5py.Group):
        for key in node if deep else ():
            yield from _arrays(file, _opened(file, f"{node.name}/{key}"), f"{name}/{key}", deep - 1, log)
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
                referred = _opened(file, h5py.h5r.get_name(reference, file.id).decode())
                yield from _arrays(file, referred, pattern.format(name, number), deep - 1, log)
    elif node.dtype.kind in "SO" and node.size == 1:
        log.facts[name] = _text(node[()])
    elif node.dtype.names:
        for field in node.dtype.names:
            if not node.dtype[field].shape:
                yield Named(f"{name}/{field}", Field(node, field), unit_of(node))
    else:
        yield Named(name, node, unit_of(node))


def _opened(file: h5py.File, name: str) -> Any:
    """What has this name; a dataset with room for those of its chunks that hold the same samples.

    So a chunk is unpacked once, and not for every slice of it, and a file of many datasets takes little memory.
    """
    node = file[name]
    if not isinstance(node, h5py.Dataset) or node.chunks is None or not node.size:
        return node
    chunks = [-(-length // chunk) for length, chunk in zip(node.shape, node.chunks, strict=True)]
    along = chunks[node.shape.index(max(node.shape))]
    beside = math.prod(chunks) // along * math.prod(node.chunks) * node.dtype.itemsize
    del node  # as long as a dataset is open, it keeps the room that it was opened with
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(SLOTS, min(beside, CACHE), 1.0)  # those that were read to their end make room first
    return h5py.Dataset(h5py.h5d.open(file.id, name.encode(), access))


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
class Field:
    """One field of a dataset of records."""

    dataset: h5py.Dataset
    field: str

    @property
    def shape(self) -> tuple[int, ...]:
        """Its lengths."""
        return tuple(self.dataset.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of its elements."""
        dtype: np.dtype[Any] = self.dataset.dtype[self.field]
        return dtype

    def __getitem__(self, part: Any) -> Any:
        """A part of it."""
        return self.dataset[(self.field, *part)]
