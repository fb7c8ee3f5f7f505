"""Read the objects of a MATLAB file of version 5 to 7.2: tables, timeseries and strings, which it stores apart.

Variables and objects are elements of 8-byte aligned parts.  An object's variable holds numbers of objects; a last
element without a name, the subsystem, holds the properties of all objects as a file within the file.
Source: MathWorks ("MAT-File Format"); for the subsystem, which is not documented, the notes of PyPI's mat-io.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from davinci_forces.files import open_file
from davinci_forces.logs.arrays import NUMBER_KINDS
from davinci_forces.maths.arrays import Array, Integers

MAT_HEADER_BYTES = 128  # [bytes] of a file
HEAD = 4096  # [bytes] of an element, which hold its name, its class and the numbers of its objects
COMPRESSED, TEXT, SPARSE, FUNCTION, OPAQUE = 15, 4, 5, 16, 17
NUMBER_CLASSES = range(6, 16)  # classes: double, single, and the integers
OBJECT_MARK = 0xDD000000  # before the numbers of objects
MAX_OBJECTS = 1000
UNNAMED = "__function_workspace__"  # scipy's name of an element without one


@dataclass(frozen=True)
class Element:
    """A variable, as its header describes it."""

    name: str
    kind: int  # its class in MATLAB's numbering
    shape: tuple[int, ...] = ()
    class_name: str = ""  # of an object
    content: bytes = b""  # of an object: the matrix of its numbers, with its tag


def elements(path: Path) -> Iterator[Element]:
    """List the variables of a file.

    Raises
    ------
    ValueError
        If the file ends within a variable.
    """
    with open_file(path) as file:
        order = _order(file.read(MAT_HEADER_BYTES)[126:])
        size = path.stat().st_size
        while tag := file.read(8):
            kind, length = struct.unpack(f"{order}II", tag)
            position = file.tell() + length
            if position > size:
                raise ValueError(f"the file ends within a variable: {length} bytes after byte {position - length}")
            head = file.read(min(length, HEAD))
            element = _element(zlib.decompressobj().decompress(head, HEAD) if kind == COMPRESSED else tag + head, order)
            if element.name:
                yield element
            file.seek(position)


def _order(mark: bytes) -> str:
    return ">" if mark == b"MI" else "<"


def _element(head: bytes, order: str) -> Element:
    flags, at = _part(head, 8, order)
    kind = flags[0] if order == "<" else flags[3]
    if kind == OPAQUE:
        name, at = _part(head, at, order)
        _, at = _part(head, at, order)  # the system that the class belongs to
        class_name, at = _part(head, at, order)
        return Element(name.decode(), kind, (), class_name.decode("utf-8", "replace"), head[at:])
    dimensions, at = _part(head, at, order)
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    return Element(_part(head, at, order)[0].decode(), kind, shape)


def _part(content: bytes, at: int, order: str) -> tuple[bytes, int]:
    """Read the part at a position, and return the position of the next; up to 4 bytes are stored in the tag."""
    (word,) = struct.unpack_from(f"{order}I", content, at)
    if word >> 16:
        return content[at + 4 : at + 4 + (word >> 16)], at + 8
    (length,) = struct.unpack_from(f"{order}I", content, at + 4)
    return content[at + 8 : at + 8 + length], at + 8 + -(-length // 8) * 8


@dataclass(frozen=True)
class MatlabObject:
    """An object: its class and its properties by name."""

    class_name: str
    properties: dict[str, Any]


def is_object(value: Any) -> bool:
    """Whether a value holds the numbers of objects."""
    return (
        isinstance(value, np.ndarray) and value.dtype == np.uint32 and value.size > 3 and value.flat[0] == OBJECT_MARK
    )


class Objects:
    """The objects of a file."""

    def __init__(self, path: Path) -> None:
        self.path, self.count = path, 0

    def of_element(self, element: Element) -> list[MatlabObject]:
        """Read the objects of a variable."""
        return self.read(_loaded(self.header, element.content))

    def read(self, reference: Any) -> list[MatlabObject]:
        """Read the objects with these numbers.

        Raises
        ------
        ValueError
            If these are no numbers of objects, or there are more than `MAX_OBJECTS`.
        """
        if not is_object(reference):
            raise ValueError("it does not refer to properties in this file")
        numbers = reference.ravel().tolist()
        ids = numbers[2 + numbers[1] : -1]
        self.count += len(ids)
        if self.count > MAX_OBJECTS:
            raise ValueError(f"the file holds more than {MAX_OBJECTS} objects")
        return [MatlabObject(self._class(numbers[-1]), self._properties(number)) for number in ids]

    @cached_property
    def header(self) -> bytes:
        """The header of the file, with the byte order."""
        with open_file(self.path) as file:
            return file.read(MAT_HEADER_BYTES)

    @cached_property
    def cells(self) -> Any:
        """Cells of the subsystem: the layout, an unused cell, the values of all properties, and their defaults last."""
        order = _order(self.header[126:])
        (position,) = struct.unpack(f"{order}Q", self.header[116:124])
        with open_file(self.path) as file:
            size = self.path.stat().st_size
            file.seek(position if MAT_HEADER_BYTES <= position < size else size)
            tag = file.read(8)
            if len(tag) < 8 or (length := struct.unpack(f"{order}II", tag)[1]) > size:
                raise ValueError("the file holds no properties of objects")
            stored = _loaded(self.header, tag + file.read(length)).tobytes()
        return _loaded(self.header[:124] + stored[:4], stored[8:])[0, 0]["MCOS"][0]["arr"].ravel()

    @cached_property
    def layout(self) -> tuple[list[str], list[Integers]]:
        """Names of classes and properties, and the four tables: classes, saved properties, objects, properties."""
        content = self.cells[0].tobytes()
        numbers = np.frombuffer(content, f"{_order(self.header[126:])}i4")
        offsets = numbers[2:7]
        names = content[40 : offsets[0]].decode("utf-8", "replace").split("\0")
        return names, [numbers[a // 4 : b // 4] for a, b in pairwise(offsets)]

    def _class(self, number: int) -> str:
        names, (classes, *_) = self.layout
        return str(names[classes[4 * number + 1] - 1])

    def _properties(self, number: int) -> dict[str, Any]:
        names, (_, saved, objects, plain) = self.layout
        class_number, _, _, of_saved, of_plain, _ = objects[6 * number : 6 * number + 6].tolist()
        defaults = self.cells[-1].ravel()[class_number]
        properties = {name: defaults[name].flat[0] for name in defaults.dtype.names or ()} if defaults.size else {}
        for name, kind, value in _record(saved if of_saved else plain, of_saved or of_plain):
            properties[names[name - 1]] = self.cells[2 + value] if kind == 1 else np.array([[value]])
        return {name.strip("_"): value for name, value in properties.items()}


def _loaded(header: bytes, element: bytes) -> Any:
    """Read an element without a name, as a file of its own."""
    return loadmat(BytesIO(header + element), appendmat=False)[UNNAMED]  # type: ignore[arg-type]


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
