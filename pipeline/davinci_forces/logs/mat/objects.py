"""Read the objects of a MATLAB file of version 5 to 7.2: tables, timeseries and strings, which it stores apart.

An object's variable holds numbers of objects; a last one without a name, the subsystem, holds the properties of all
objects as a file within the file.
Source: MathWorks ("MAT-File Format"); for the subsystem, which is not documented, the notes of PyPI's mat-io.
"""

from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.io import loadmat

from davinci_forces.logs.arrays import NUMBER_KINDS
from davinci_forces.maths.arrays import Array, Integers

OBJECT_MARK = 0xDD000000  # before the numbers of objects
MAX_OBJECTS = 1000
UNNAMED = "__function_workspace__"  # scipy's name of an element without one


@dataclass(frozen=True)
class MatlabObject:
    """An object: its class and its properties by name."""

    class_name: str
    properties: dict[str, Any]


def is_object(value: Any) -> bool:
    """Whether a value holds the numbers of objects."""
    are_numbers = isinstance(value, np.ndarray) and value.dtype == np.uint32
    return are_numbers and value.size > 3 and bool(value.flat[0] == OBJECT_MARK)


class Objects:
    """The objects of a file; `workspace` is the variable without a name, which holds their properties."""

    def __init__(self, workspace: BytesIO | None) -> None:
        self.workspace, self.count = workspace, 0

    def read(self, reference: Any) -> list[MatlabObject]:
        """Read the objects with these numbers; raises ValueError if these are none, or beyond `MAX_OBJECTS`."""
        if not is_object(reference):
            raise ValueError("it does not refer to properties in this file")
        numbers = reference.ravel().tolist()
        ids = numbers[2 + numbers[1] : -1]
        self.count += len(ids)
        if self.count > MAX_OBJECTS:
            raise ValueError(f"the file holds more than {MAX_OBJECTS} objects")
        names, (classes, *_) = self.layout
        name = str(names[classes[4 * numbers[-1] + 1] - 1])
        return [MatlabObject(name, self._properties(number)) for number in ids]

    @cached_property
    def cells(self) -> Any:
        """Cells of the subsystem: the layout, an unused cell, the values of all properties, and their defaults last."""
        if self.workspace is None:
            raise ValueError("the file holds no properties of objects")
        stored = loadmat(self.workspace)[UNNAMED].tobytes()  # type: ignore[arg-type]
        inner = BytesIO(self.workspace.getvalue()[:124] + stored[:4] + stored[8:])
        return loadmat(inner)[UNNAMED][0, 0]["MCOS"][0]["arr"].ravel()  # type: ignore[arg-type]

    @cached_property
    def layout(self) -> tuple[list[str], list[Integers]]:
        """Names of classes and properties, and the four tables: classes, saved properties, objects, properties."""
        content = self.cells[0].tobytes()
        assert self.workspace
        is_big_endian = self.workspace.getvalue()[126:128] == b"MI"
        numbers = np.frombuffer(content, ">i4" if is_big_endian else "<i4")
        offsets = numbers[2:7]
        names = content[40 : offsets[0]].decode("utf-8", "replace").split("\0")
        return names, [numbers[a // 4 : b // 4] for a, b in pairwise(offsets)]

    def _properties(self, number: int) -> dict[str, Any]:
        names, (_, saved, objects, plain) = self.layout
        class_number, _, _, of_saved, of_plain, _ = objects[6 * number : 6 * number + 6].tolist()
        defaults = self.cells[-1].ravel()[class_number]
        properties = {name: defaults[name].flat[0] for name in defaults.dtype.names or ()} if defaults.size else {}
        for name, kind, value in _record(saved if of_saved else plain, of_saved or of_plain):
            properties[names[name - 1]] = self.cells[2 + value] if kind == 1 else np.array([[value]])
        return {name.strip("_"): value for name, value in properties.items()}


def _record(table: Integers, number: int) -> list[list[int]]:
    """Read a record: a count, so many triples of name, kind and value, and padding to an even length."""
    at = 0
    for _ in range(number):
        at += 1 + 3 * int(table[at])
        at += at % 2
    return table[at + 1 : at + 1 + 3 * int(table[at])].reshape(-1, 3).tolist()


def seconds(values: Any) -> Array:
    """Times of a duration or a datetime [ms] (N,), whose imaginary part is the rest of the real one, in seconds."""
    return np.asarray(values.real, np.float64).ravel() / 1e3 + np.asarray(values.imag, np.float64).ravel() / 1e3


def text_of(numbers: Any) -> str:
    """The first text of a string array: version, dimensions, lengths, and letters of 16 bits."""
    values = numbers.ravel().tolist()
    dimensions = values[1]
    count = int(np.prod(values[2 : 2 + dimensions]))
    letters = numbers.ravel()[2 + dimensions + count :].tobytes()
    return letters[: 2 * values[2 + dimensions]].decode("utf-16", "replace") if count else ""


def uniform_times(properties: dict[str, Any], info: dict[str, Any]) -> Array | None:
    """Times (N, 1) of a timeseries that stores only their start and increment, as it does for a uniform one."""
    time, data = properties.get("Time"), properties.get("Data")
    increment, start = (np.asarray(info.get(name, ())).ravel() for name in ("Increment", "Start"))
    is_stored = isinstance(time, np.ndarray) and time.size > 0
    if is_stored or not isinstance(data, np.ndarray) or not increment.size or increment.dtype.kind not in NUMBER_KINDS:
        return None
    count = np.asarray(info.get("Length", max(data.shape))).ravel()[0]
    first = start[0] if start.size else 0.0
    if not (increment[0] > 0 and np.isfinite(first)) or int(count) not in data.shape:
        return None
    return np.asarray(first + increment[0] * np.arange(int(count)))[:, None]
