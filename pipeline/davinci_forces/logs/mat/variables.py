"""Read the variables of a MATLAB file as arrays, with scipy, or with h5py for version 7.3."""

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque, varmats_from_mat

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.arrays import MAX_DEPTH, ArrayLog, NamedArray, matlab_object, take_in
from davinci_forces.logs.log import Log
from davinci_forces.logs.mat.objects import MatlabObject, Objects, is_object, seconds, text_of, uniform_times

MAX_ELEMENTS = 1000  # of a struct array or a cell array
NESTED = ("cell", "struct", "object", "char", "unknown")  # classes of variables that are not numbers
OBJECT = "None"  # scipy's name of a variable that holds an object


def open_in_child(path: Path) -> Log:
    """Open the file; raises BadLog if it holds no variable of samples."""
    log = ArrayLog(path, "mat", ())
    with open_file(path) as file:
        head = file.read(128)
    header = head[:116].split(b"\0")[0].decode("ascii", "replace").strip() if head.startswith(b"MATLAB") else ""
    if header:
        log.facts["header"] = header
    if header.startswith("MATLAB 7.3"):
        import h5py

        from davinci_forces.logs.hdf5.datasets import arrays_of

        arrays = list(arrays_of(h5py.File(path, "r", locking=False), log))
    else:
        arrays = list(_of_matlab(path, log))
    take_in(log, with_clocks(arrays, log.facts))
    if not log.channels:
        names = "; ".join([", ".join(array.name for array in arrays) or "nothing that is read", *log.warnings])
        raise BadLog(f"{path}: it holds no variable of samples; it has {names}")
    return log


def _of_matlab(path: Path, log: Log) -> Iterator[NamedArray]:
    with open_file(path) as file:
        is_old = 0 in file.read(4)  # version 4 begins with numbers, later ones with text
        parts: list[tuple[str, Any]] = [("", path)] if is_old else varmats_from_mat(file)
    reader = _Reader(log, Objects(None if is_old else next((part for name, part in parts if not name), None)))
    for name, part in parts:
        if name == OBJECT:
            value = loadmat(part)[name]
            name = value[0]["s0"].decode() if isinstance(value, MatlabOpaque) else name
            yield from reader.arrays(name, value, MAX_DEPTH)
        elif name or is_old:
            yield from reader.variables(part)


@dataclass
class Variable:
    """A variable of numbers, read completely at the first access and then kept."""

    path: Path
    source: Any  # the file, or the bytes of this variable
    name: str
    shape: tuple[int, ...]
    dtype = np.dtype(np.float64)  # of its elements; complex ones are only known from the values

    @cached_property
    def values(self) -> Any:
        """All elements."""
        values = _loaded(self.source, self.name)
        values = values.toarray() if hasattr(values, "toarray") else values
        if np.iscomplexobj(values):
            raise BadLog(f"{self.path}: variable {self.name!r} holds complex numbers; save its parts")
        return values

    def __getitem__(self, part: Any) -> Any:
        return self.values[part]


def _loaded(source: Any, name: str) -> Any:
    return loadmat(source, appendmat=False, variable_names=[name])[name]


@dataclass(frozen=True)
class _Reader:
    """Lists the arrays of structs, cells and objects, by their names in MATLAB."""

    log: Log
    objects: Objects

    def variables(self, source: Any) -> Iterator[NamedArray]:
        """List the arrays of variables; those of numbers are read later."""
        for name, shape, kind in whosmat(source, appendmat=False):
            if kind == "function":
                self.log.warnings.append(f"{name} is a function of MATLAB, which holds no samples, and is left out")
            elif kind in NESTED:
                yield from self.arrays(name, _loaded(source, name), MAX_DEPTH)
            else:
                yield NamedArray(name, Variable(self.log.path, source, name, shape))

    def arrays(self, name: str, value: Any, deep: int) -> Iterator[NamedArray]:
        """List the arrays of a value."""
        if isinstance(value, MatlabOpaque):
            yield from self._objects(name, value[0]["s2"].decode(), lambda: self.objects.read(value[0]["arr"]), deep)
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
