"""The base classes of the records that stages exchange.

A record has a few scalars, which describe its subject, and columns of one length, which hold measurements or
estimates.  Its constructor checks it, so that stages can rely on it and `store` can write every kind in the same way.
Every field is a symbol of `quantities`.  `KEY` names the scalars that identify a record among its kind and give its
file name.

`PUBLISHED` lists the numbers of the record in results.json: a prefix of keys, which may hold scalars, and fields, as in
`tuning.{joint}: r_q rmse±`.  `±` adds the standard error, and `key=field` renames the field; an empty key is the
prefix itself.  With `{row}` (its number from 1), `{name}` or `{slug}` in the prefix, each row of the columns has keys.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeVar, dataclass_transform
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadRecord
from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array, Booleans, Integers, row_blocks

Column = Array
Counts = Integers
Labels = NDArray[np.object_]
Names = tuple[str, ...]

COLUMN_DTYPES: dict[Any, Any] = {Column: np.float64, Counts: np.int64, Labels: np.object_}


class Origin(NamedTuple):
    """The origin of a record: its file, the hash of the file, and the units of its fields."""

    path: str
    sha256: str
    units: dict[str, str]


class Published(NamedTuple):
    """A number of a record in results.json: a field, or a row of a column, under a key."""

    key: str
    field: str
    std: str = ""  # the field that holds its standard error
    row: int | None = None


@dataclass_transform(frozen_default=True, eq_default=False)
class Record:
    """The abstract base of all records; each is a frozen dataclass, compared by identity."""

    KEY: ClassVar[Names]
    UNKNOWN: ClassVar[Names] = ()  # columns in which NaN means unknown
    ROWS: ClassVar[str] = ""  # the column of row names, where rows have names
    PUBLISHED: ClassVar[Names] = ()
    origin: ClassVar[Origin | None] = None  # set by `store` on the records that it reads

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False)(cls)

    @classmethod
    def folder(cls) -> str:
        """Return the folder of the kind's files, its name in snake case: `log_summary`."""
        return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()

    @classmethod
    @cache
    def columns(cls) -> Names:
        """Return the names of the column fields."""
        return tuple(f.name for f in fields(cls) if f.type in COLUMN_DTYPES)  # type: ignore[arg-type]

    @classmethod
    @cache
    def scalars(cls) -> Names:
        """Return the names of the scalar fields."""
        return tuple(f.name for f in fields(cls) if f.type not in COLUMN_DTYPES)  # type: ignore[arg-type]

    @classmethod
    def like(cls, *sources: object, **others: Any) -> Self:
        """Return a record of other values, and for the rest the attributes of sources, the first ones preferred.

        A record with columns of a lazy source is lazy, too; such a source is the last one.
        """
        *preferred, source = sources
        for each in reversed(preferred):
            others = {f.name: getattr(each, f.name) for f in fields(cls) if hasattr(each, f.name)} | others  # type: ignore[arg-type]
        if isinstance(source, Record) and "_read" in vars(source) and not others.keys() >= {*cls.columns()}:
            scalars = {name: others[name] if name in others else getattr(source, name) for name in cls.scalars()}
            read = vars(source)["_read"]
            return cls.lazy(
                scalars,
                len(source),
                lambda name, rows: others[name][rows].copy() if name in others else read(name, rows),
            )
        shared = (f.name for f in fields(cls) if f.name not in others and hasattr(source, f.name))  # type: ignore[arg-type]
        return cls(**{name: getattr(source, name) for name in shared}, **others)

    @classmethod
    def lazy(cls, scalars: Mapping[str, Any], length: int, read: Callable[[str, slice], NDArray[Any]]) -> Self:
        """Return a record with these scalars that reads rows of a column, by its name, when they are accessed.

        A column stays in memory while the stage uses it.  Each access checks what it reads.
        """
        record = object.__new__(cls)
        record.__dict__.update(scalars, _length=length, _read=read, _in_use=WeakValueDictionary())
        return record

    def part(self, which: slice) -> Self:
        """Return the record of some of the rows; that of a lazy record is lazy, too."""
        if read := self.__dict__.get("_read"):
            scalars = {name: getattr(self, name) for name in self.scalars()}
            start, stop, _ = which.indices(len(self))
            return self.lazy(scalars, stop - start, lambda name, rows: read(name, slice(
                start + (rows.start or 0), stop if rows.stop is None else start + rows.stop
            )))  # fmt: skip
        return self.select(which)

    def select(self, which: slice | Booleans | Integers) -> Self:
        """Return the record of some of the rows, in memory."""
        return self.like(self, **{name: getattr(self, name)[which] for name in self.columns()})

    def blocks(self) -> Iterator[Self]:
        """Yield the record, or one of many rows in parts."""
        is_long = len(self) > BLOCK_SAMPLES
        return (self.part(rows) for rows in row_blocks(len(self))) if is_long else iter([self])

    if not TYPE_CHECKING:  # so that type checkers still report names that no record has

        def __getattr__(self, name: str) -> Any:
            """Read a column of a lazy record; Python calls this only where there is no such attribute."""
            if name not in self.columns() or "_read" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            column = self._in_use.get(name)
            if column is None:
                column = self._in_use[name] = self._checked(name, self._read(name, slice(None)))
            return column

    @property
    def key(self) -> Names:
        """The values of `KEY`, unique among the records of a kind."""
        return tuple(str(getattr(self, name)) for name in self.KEY)

    def published(self) -> Iterator[Published]:
        """Yield the numbers of this record for results.json."""
        for numbers in self.PUBLISHED:
            prefix, _, names = numbers.partition(": ")
            yield from self.publish(prefix, names)

    def publish(self, prefix: str, names: str) -> Iterator[Published]:
        """Yield the numbers of an entry of `PUBLISHED`."""
        scalars = {name: getattr(self, name) for name in self.scalars()}
        is_by_row = any(word in prefix for word in ("{row}", "{name}", "{slug}"))
        for row in range(len(self)) if is_by_row else (None,):
            name = "" if row is None else self.row_name(row)
            place = prefix.format(**scalars, row=(row or 0) + 1, name=name, slug=slug(name))
            for text in names.split():
                key, is_renamed, field = text.removesuffix("±").rpartition("=")
                full_key = f"{place}.{key if is_renamed else field}".removesuffix(".")
                yield Published(full_key, field, f"{field}_std" if text.endswith("±") else "", row)

    def row_name(self, row: int) -> str:
        """Return the name of a row, for tracing a number back to it."""
        return str(getattr(self, self.ROWS)[row]) if self.ROWS else str(row)

    def row_number(self, name: str) -> int:
        """Return the row with a name; raises ValueError if no row has that name."""
        return [str(label) for label in getattr(self, self.ROWS)].index(name) if self.ROWS else int(name)

    def __post_init__(self) -> None:
        for f in fields(self):  # type: ignore[arg-type]
            if f.type in COLUMN_DTYPES:
                column = np.asarray(getattr(self, f.name), dtype=COLUMN_DTYPES[f.type], order="C")
                object.__setattr__(self, f.name, column)
        lengths = {name: len(getattr(self, name)) for name in self.columns()}
        if len(set(lengths.values())) > 1:
            raise BadRecord(f"{self}: columns differ in length: {lengths}")
        for name in lengths:
            self._checked(name, getattr(self, name))

    def _checked(self, name: str, column: NDArray[Any]) -> NDArray[Any]:
        """Return the column if all its numbers are finite."""
        if column.dtype.kind == "f" and name not in self.UNKNOWN and not np.isfinite(column).all():
            rows = np.flatnonzero(~np.isfinite(column))
            raise BadRecord(
                f"{self}: {name} has {len(rows)} values that are not finite, the first at row {rows[0]}; look at the "
                "remarks on the logs, and check the units and columns of their channels in study.toml"
            )
        return column

    def __str__(self) -> str:
        return f"{type(self).__name__} {'/'.join(self.key)}"

    def __len__(self) -> int:
        columns = self.columns()
        if "_length" in self.__dict__:
            return int(self.__dict__["_length"])
        return len(getattr(self, columns[0])) if columns else 0


AnyRecord = TypeVar("AnyRecord", bound=Record)
Group = TypeVar("Group")
Member = TypeVar("Member")


class LogRecord(Record):
    """A record of one log."""

    KEY: ClassVar[Names] = ("log",)

    log: str


class LogJointRecord(LogRecord):
    """A record of one joint during one log."""

    KEY: ClassVar[Names] = ("log", "joint")

    joint: str


class JointRecord(Record):
    """A record of one joint over all logs."""

    KEY: ClassVar[Names] = ("joint",)

    joint: str


class RobotRecord(Record):
    """A record of the whole robot."""

    KEY: ClassVar[Names] = ("robot",)

    robot: str


def slug(text: str) -> str:
    """Convert a name for use in a key: 'gravity, sine' becomes gravity_sine."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


class Diagnostic(Record):
    """Messages of a stage to the reviewer: about omissions, assumptions and errors."""

    KEY = ("stage", "subject")

    stage: str
    subject: str
    severity: Labels
    text: Labels


def groups_of(pairs: Iterable[tuple[Group, Member]]) -> dict[Group, list[Member]]:
    """The members of each group of pairs (group, member), in the order in which the groups first occur."""
    groups: dict[Group, list[Member]] = {}
    for group, member in pairs:
        groups.setdefault(group, []).append(member)
    return groups


def by_name(records: Iterable[AnyRecord], scalar: str) -> dict[str, list[AnyRecord]]:
    """Group records by the value of a scalar, as by their joint."""
    return groups_of((getattr(record, scalar), record) for record in records)


def first_of_each_kind(remarks: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Yield the first of the remarks (stage, text) that begin alike after the log's name, and count the others.

    Numbers do not make a kind: "harmonic 3 of" and "harmonic 4 of" begin alike.
    """
    kinds: dict[tuple[str, ...], list[str]] = {}
    for stage, text in remarks:
        words = (text.partition(": ")[2] or text).split()[:3]
        kinds.setdefault((stage, *(re.sub(r"\d+", "0", word) for word in words)), []).append(text)
    for (stage, *_), (first, *others) in kinds.items():
        more = f" ({len(others)} more remark{'s' * (len(others) > 1)} of this kind)" if others else ""
        yield stage, first + more


def diagnostic(stage: str, subject: str, severity: str, *texts: str) -> Diagnostic:
    """Build a diagnostic of one or more lines with one severity."""
    return Diagnostic(stage, subject, np.array([severity] * len(texts), object), np.array(texts, object))


def as_list(parts: Sequence[str]) -> str:
    """Parts of a sentence as a list: 'a, b and c'."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if parts[1:] else parts)


def join_names(names: Sequence[str]) -> str:
    """Names as a list, with quotes around one that has a comma."""
    return as_list([f'"{name}"' if "," in name else name for name in names])
