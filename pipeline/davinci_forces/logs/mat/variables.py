"""Read the variables of a MATLAB file as arrays, with scipy, or with h5py for version 7.3."""

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.arrays import MAX_DEPTH, ArrayLog, NamedArray, matlab_object, take_in
from davinci_forces.logs.isolated import require
from davinci_forces.logs.log import Log, Options
from davinci_forces.logs.mat.objects import (
    FUNCTION,
    NUMBER_CLASSES,
    OPAQUE,
    SPARSE,
    TEXT,
    Element,
    MatlabObject,
    Objects,
    elements,
    is_object,
    seconds,
    text_of,
    uniform_times,
)  # fmt: skip

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
        names = "; ".join([", ".join(array.name for array in arrays) or "nothing that is read", *log.warnings])
        raise BadLog(f"{path}: it holds no variable of samples; it has {names}")
    return log


def _of_hdf5(path: Path, log: Log) -> Iterator[NamedArray]:
    require(path, "h5py", "hdf5")
    import h5py

    from davinci_forces.logs.hdf5.datasets import arrays_of

    yield from arrays_of(h5py.File(path, "r", locking=False), log)


def _of_matlab(path: Path, log: Log) -> Iterator[NamedArray]:
    with open_file(path) as file:
        is_old = 0 in file.read(4)  # version 4 begins with numbers, later ones with text
    variables = elements(path) if not is_old else [
        Element(name, TEXT if kind == "char" else NUMBER_CLASSES[0], shape)
        for name, shape, kind in whosmat(path, appendmat=False)
    ]  # fmt: skip
    reader = _Reader(log, Objects(path))
    for variable in variables:
        if variable.kind in NUMBER_CLASSES or variable.kind == SPARSE:
            yield NamedArray(variable.name, Variable(path, variable.name, variable.shape))
        elif variable.kind == FUNCTION:
            log.warnings.append(f"{variable.name} is a function of MATLAB, which holds no samples, and is left out")
        elif variable.kind == OPAQUE:
            yield from reader.objects_of(variable)
        else:
            value = loadmat(path, appendmat=False, variable_names=[variable.name])[variable.name]
            yield from reader.arrays(variable.name, value, MAX_DEPTH)


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


@dataclass(frozen=True)
class _Reader:
    """Lists the arrays of structs, cells and objects, by their names in MATLAB."""

    log: Log
    objects: Objects

    def arrays(self, name: str, value: Any, deep: int) -> Iterator[NamedArray]:
        """List the arrays of a value."""
        if isinstance(value, MatlabOpaque):
            yield from self._objects(name, value[0]["s2"], lambda: self.objects.read(value[0]["arr"]), deep)
        elif is_object(value):
            yield from self._objects(name, "", lambda: self.objects.read(value), deep)
        elif value is None:  # scipy's empty struct
            return
        elif isinstance(value, MatlabFunction) or not isinstance(value, np.ndarray):
            self.log.warnings.append(f"{name} is neither numbers nor text, and is left out")
        elif value.dtype.kind in "US":
            self.log.facts[name] = "".join(map(str, value.ravel()[:1]))[:200]
        elif value.dtype.names or value.dtype.kind == "O":
            cell, many = not value.dtype.names, value.size > 1
            for number, element in enumerate(value.ravel(order="F")[:MAX_ELEMENTS] if deep else (), start=1):
                called = f"{name}{{{number}}}" if cell else f"{name}({number})" if many else name
                keys = value.dtype.names or ()
                fields = {called: element} if cell else {f"{called}/{key}": element[key] for key in keys}
                for key, inner in fields.items():
                    yield from self.arrays(key, inner, deep - 1)
        elif value.size:
            yield NamedArray(name, value)

    def objects_of(self, variable: Element) -> Iterator[NamedArray]:
        """List the arrays of a variable that holds objects."""
        name, kind = variable.name, variable.class_name
        yield from self._objects(name, kind, lambda: self.objects.of_element(variable), MAX_DEPTH)

    def _objects(self, name: str, kind: str, read: Callable[[], list[MatlabObject]], deep: int) -> Iterator[NamedArray]:
        """List the arrays of objects, or say why they cannot be read: their layout is not documented."""
        try:
            objects = read() if deep else []
            for number, one in enumerate(objects, start=1):
                yield from list(self._object(f"{name}({number})" if len(objects) > 1 else name, one, deep - 1))
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, struct.error, zlib.error) as error:
            self.log.warnings.append(f"{matlab_object(name, kind)} ({error})")

    def _object(self, name: str, one: MatlabObject, deep: int) -> Iterator[NamedArray]:
        properties = one.properties
        if one.class_name == "string":
            self.log.facts[name] = text_of(properties["any"])[:200]
        elif one.class_name in ("duration", "datetime"):
            yield NamedArray(name, seconds(properties["millis" if one.class_name == "duration" else "data"]), "s")
        elif one.class_name == "timetable":
            yield from self._timetable(name, properties["any"].flat[0], deep)
        elif one.class_name == "table":
            units = properties["props"].flat[0]["VariableUnits"]
            yield from self._columns(name, properties["data"], properties["varnames"], units, deep)
        else:
            info = properties.get("TimeInfo")
            [about] = self.objects.read(info) if is_object(info) else [MatlabObject("", {})]
            times = uniform_times(properties, about.properties)
            for key, value in (properties | ({} if times is None else {"Time": times})).items():
                yield from self.arrays(f"{name}/{key}", value, deep)

    def _timetable(self, name: str, content: Any, deep: int) -> Iterator[NamedArray]:
        """List the columns of a timetable on its row times, which may be a start and a step."""
        times, rows = content["rowTimes"], int(content["numRows"].flat[0])
        if times.dtype.names:
            step = times.flat[0]
            rate = float(step["sampleRate"].flat[0]) if step["specifiedAsRate"].flat[0] else 0.0
            [origin] = self.arrays("", step["origin"], deep)
            interval = [1 / rate] if rate else [float(a.data[0]) for a in self.arrays("", step["stepSize"], deep)]
            row_times = float(origin.data[0]) + interval[0] * np.arange(rows)
        else:
            [stored] = self.arrays("", times, deep)
            row_times = np.asarray(stored.data)
        yield NamedArray(f"{name}/Time", row_times, "s")
        for array in self._columns(name, content["data"], content["varNames"], content["varUnits"], deep):
            yield replace(array, time=f"{name}/Time") if array.rows == rows else array

    def _columns(self, name: str, data: Any, names: Any, units: Any, deep: int) -> Iterator[NamedArray]:
        written = [str(unit.flat[0]) if unit.size else "" for unit in units.ravel()] or [""] * data.size
        for called, column, unit in zip(names.ravel(), data.ravel(), written, strict=True):
            for array in self.arrays(f"{name}/{called.flat[0]}", column, deep):
                yield replace(array, unit=array.unit or unit)


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
        replace(a, time=clock.get(a.name, a.time), unit="s" if a.name in clock.values() else a.unit or units[a.name])
        for a in arrays
    ]
