"""Read the variables of a MATLAB file as arrays, with scipy, or with h5py for version 7.3."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.arrays import MAX_DEPTH, ArrayLog, NamedArray, matlab_object, take_in
from davinci_forces.logs.log import Log, Options

NUMBER_CLASSES = {"double", "single", "logical", *(f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64))}
MAX_ELEMENTS = 1000  # of a struct array or a cell array


def open_in_child(path: Path, options: Options) -> Log:
    """Open the file.

    Raises
    ------
    BadLog
        If it holds no variable of samples.
    """
    log = ArrayLog(path, "mat", ())
    with open_file(path) as file:
        head = file.read(128)
    header = head[:116].split(b"\0")[0].decode("ascii", "replace").strip() if head.startswith(b"MATLAB") else ""
    if header:
        log.facts["header"] = header
    arrays = list(_of_hdf5(path, log) if header.startswith("MATLAB 7.3") else _of_matlab(path, log))
    take_in(log, with_clocks(arrays, log.facts))
    if not log.channels:
        names = ", ".join(array.name for array in arrays) or "nothing that is read"
        raise BadLog(f"{path}: it holds no variable of samples; it has {names}")
    return log


def _of_hdf5(path: Path, log: Log) -> Iterator[NamedArray]:
    import h5py

    from davinci_forces.logs.hdf5.datasets import arrays_of

    yield from arrays_of(h5py.File(path, "r", locking=False), log)


def _of_matlab(path: Path, log: Log) -> Iterator[NamedArray]:
    for name, shape, kind in whosmat(path, appendmat=False):
        if kind in NUMBER_CLASSES:
            yield NamedArray(name, Variable(path, name, shape))
        else:
            value = loadmat(path, appendmat=False, variable_names=[name]).get(name)
            yield from _arrays(name, value, MAX_DEPTH, log)


@dataclass
class Variable:
    """A variable of numbers, read completely at the first access and then kept."""

    path: Path
    name: str
    shape: tuple[int, ...]
    kept: list[Any] = field(default_factory=list)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of its elements; complex ones are only known from the values."""
        return np.dtype(np.float64)

    def __getitem__(self, part: Any) -> Any:
        """Read a part of it."""
        if not self.kept:
            self.kept.append(loadmat(self.path, appendmat=False, variable_names=[self.name])[self.name])
        values = self.kept[0]
        values = values.toarray() if hasattr(values, "toarray") else values
        if np.iscomplexobj(values):
            raise BadLog(f"{self.path}: variable {self.name!r} holds complex numbers; save its parts")
        return values[part]


def _arrays(name: str, value: Any, deep: int, log: Log) -> Iterator[NamedArray]:
    """List the arrays of a struct or a cell, by their names in MATLAB."""
    if isinstance(value, MatlabOpaque | MatlabFunction) or not isinstance(value, np.ndarray):
        log.warnings.append(matlab_object(name))
    elif value.dtype.kind in "US":
        log.facts[name] = "".join(map(str, value.ravel()[:1]))[:200]
    elif value.dtype.names or value.dtype.kind == "O":
        cell, many = not value.dtype.names, value.size > 1
        for number, element in enumerate(value.ravel(order="F")[:MAX_ELEMENTS] if deep else (), start=1):
            called = f"{name}{{{number}}}" if cell else f"{name}({number})" if many else name
            fields = {called: element} if cell else {f"{called}/{key}": element[key] for key in value.dtype.names or ()}
            for key, inner in fields.items():
                yield from _arrays(key, inner, deep - 1, log)
    elif value.size:
        yield NamedArray(name, value)


# Names of times and values in structs that MATLAB makes of a timeseries, and Simulink of its logs.
TIMED = (("/Time", ("/Data",)), ("/time", ("/signals/", "/signals(")))


def with_clocks(arrays: Sequence[NamedArray], facts: dict[str, str]) -> list[NamedArray]:
    """Make the times of a timeseries or of a Simulink log the clock of its values."""
    clock: dict[str, str] = {}
    for array in arrays:
        for ending, followed in TIMED:
            stem = array.name.removesuffix(ending)
            if stem != array.name and facts.get(f"{stem}/TimeInfo/Units", "seconds") == "seconds":
                values = tuple(stem + suffix for suffix in followed)
                same = (a.name for a in arrays if a.name.startswith(values) and a.rows == array.rows)
                clock |= dict.fromkeys(same, array.name)
    units = {a.name: facts.get(f"{a.name.removesuffix('/Data')}/DataInfo/Units", "") for a in arrays}
    return [
        replace(a, time=clock.get(a.name, ""), unit="s" if a.name in clock.values() else a.unit or units[a.name])
        for a in arrays
    ]
