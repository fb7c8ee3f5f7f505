"""The records that flow between stages.

A record is a few scalars that say what it is about, and columns of one length that say what was measured or
estimated.  It checks itself once, when made, so a stage can trust what it is handed and `store` can write any of
them the same way.  Every field is a symbol of `quantities`.  `KEY` names the scalars that tell one record of a
kind from another: they are its place on disk.  `published` says which of its numbers results.json holds.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadRecord
from davinci_forces.maths.arrays import Array, Integers

Column = Array
Counts = Integers
Labels = NDArray[np.object_]
Names = tuple[str, ...]

COLUMN_DTYPES: dict[Any, Any] = {Column: np.float64, Counts: np.int64, Labels: np.object_}


class Origin(NamedTuple):
    """Where a record was read from: the file, its hash, and the units of its fields."""

    path: str
    sha256: str
    units: dict[str, str]


class Published(NamedTuple):
    """A number of a record that results.json holds: the field, or the row of a column, under a key."""

    key: str
    field: str
    std: str = ""  # the field that holds its standard error
    row: int | None = None


class Record:
    """What all records share; never made itself."""

    KEY: ClassVar[Names]
    UNKNOWN: ClassVar[Names] = ()  # columns in which NaN says that a number is not known
    ROWS: ClassVar[str] = ""  # the column that names the rows, where rows have names
    origin: ClassVar[Origin | None] = None  # set on the instances that `store` read

    @classmethod
    def folder(cls) -> str:
        """The folder of its files, its name in lower case: `log_summary`."""
        return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()

    @classmethod
    def columns(cls) -> Names:
        """Names of the fields that are columns."""
        return tuple(f.name for f in fields(cls) if f.type in COLUMN_DTYPES)  # type: ignore[arg-type]

    @classmethod
    def scalars(cls) -> Names:
        """Names of the fields that are scalars."""
        return tuple(f.name for f in fields(cls) if f.type not in COLUMN_DTYPES)  # type: ignore[arg-type]

    @classmethod
    def later(cls, scalars: Mapping[str, Any], column: Callable[[str], NDArray[Any]]) -> Self:
        """A record with these scalars, whose columns are read, by name, whenever they are asked for.

        A column is checked each time; nothing checks that all are of one length.
        """
        record = object.__new__(cls)
        record.__dict__.update(scalars, _column=column)
        return record

    if not TYPE_CHECKING:  # or a name that no record has would be found in no other way than by running

        def __getattr__(self, name: str) -> Any:
            """A column that is not held, which is asked for here only where there is no attribute of that name."""
            if name not in self.columns() or "_column" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            return self._checked(name, self.__dict__["_column"](name))

    @property
    def key(self) -> Names:
        """What tells this record from others of its kind."""
        return tuple(str(getattr(self, name)) for name in self.KEY)

    def published(self) -> Iterator[Published]:
        """The numbers of this record that belong in results.json."""
        return iter(())

    def publish(self, prefix: str, *names: str, row: int | None = None, with_std: bool = False) -> Iterator[Published]:
        """Scalars, or a row of columns, under `<prefix>.<name>`, with their standard errors or without."""
        return (Published(f"{prefix}.{name}", name, f"{name}_std" if with_std else "", row) for name in names)

    def row_name(self, row: int) -> str:
        """What a row is called where a number is traced back to it."""
        return str(getattr(self, self.ROWS)[row]) if self.ROWS else str(row)

    def row_number(self, name: str) -> int:
        """The row of that name.

        Raises
        ------
        ValueError
            If there is none.
        """
        return [str(label) for label in getattr(self, self.ROWS)].index(name) if self.ROWS else int(name)

    def __post_init__(self) -> None:
        for f in fields(self):  # type: ignore[arg-type]
            if f.type in COLUMN_DTYPES:
                column = np.asarray(getattr(self, f.name), dtype=COLUMN_DTYPES[f.type])
                object.__setattr__(self, f.name, column)
        lengths = {name: len(getattr(self, name)) for name in self.columns()}
        if len(set(lengths.values())) > 1:
            raise BadRecord(f"{self}: columns differ in length: {lengths}")
        for name in lengths:
            self._checked(name, getattr(self, name))

    def _checked(self, name: str, column: NDArray[Any]) -> NDArray[Any]:
        """A column, once it is known that its numbers are finite."""
        if column.dtype.kind == "f" and name not in self.UNKNOWN and not np.isfinite(column).all():
            bad = np.flatnonzero(~np.isfinite(column))
            raise BadRecord(f"{self}: {name} has {len(bad)} values that are not finite, the first at row {bad[0]}")
        return column

    def __str__(self) -> str:
        return f"{type(self).__name__} {'/'.join(self.key)}"

    def __len__(self) -> int:
        columns = self.columns()
        return len(getattr(self, columns[0])) if columns else 0


AnyRecord = TypeVar("AnyRecord", bound=Record)


@dataclass(frozen=True, eq=False)
class LogRecord(Record):
    """A record of one log."""

    KEY: ClassVar[Names] = ("log",)

    log: str


@dataclass(frozen=True, eq=False)
class LogJointRecord(LogRecord):
    """A record of one joint during one log."""

    KEY: ClassVar[Names] = ("log", "joint")

    joint: str


@dataclass(frozen=True, eq=False)
class JointRecord(Record):
    """A record of one joint over all logs."""

    KEY: ClassVar[Names] = ("joint",)

    joint: str


@dataclass(frozen=True, eq=False)
class RobotRecord(Record):
    """A record of the whole robot."""

    KEY: ClassVar[Names] = ("robot",)

    robot: str


def slug(text: str) -> str:
    """A name as it stands in a key: 'gravity, sine' is gravity_sine."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


@dataclass(frozen=True, eq=False)
class Diagnostic(Record):
    """What a stage wants the reviewer to know: something left out, assumed, or wrong."""

    KEY = ("stage", "subject")

    stage: str
    subject: str
    severity: Labels
    text: Labels


def diagnostic(stage: str, subject: str, severity: str, *texts: str) -> Diagnostic:
    """A diagnostic of one or more lines of one severity."""
    return Diagnostic(stage, subject, np.array([severity] * len(texts), object), np.array(texts, object))
