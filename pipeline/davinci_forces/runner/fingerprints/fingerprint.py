"""The fingerprint of a task: all that its outputs depend on, and a description of what changed."""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from datetime import date, time
from enum import Enum
from functools import cache
from hashlib import sha256
from pathlib import PurePath
from typing import Any

import numpy as np

from davinci_forces.records import COLUMN_DTYPES, Record
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.runner.signature import declaration

PLAIN = (str, float, int, bool, type(None))
REASONS = {  # part of a fingerprint -> reason to run
    "given": "the {} changed",
    "schemas": "the declaration of {} changed",
    "code": "the code of {} changed",
    "inputs": "{} changed",
}


def hash_of_text(text: str) -> str:
    """The sha256 of a text."""
    return sha256(text.encode()).hexdigest()


def hash_of(value: Any) -> str:
    """The sha256 of a value's content; arrays are hashed by their bytes, since `repr` rounds."""
    return hash_of_text(canonical(value))


def canonical(value: Any) -> str:
    """A text that is equal for two values only if their contents are; raises TypeError for a type without one."""
    if type(value) in PLAIN:  # the most frequent case
        return repr(value)
    if is_dataclass(value) and not isinstance(value, type):
        items = (f"{f.name}={canonical(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({', '.join(items)})"
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"array({value.dtype.str}, {value.shape}, {sha256(value.tobytes()).hexdigest()})"
    if isinstance(value, dict):
        return f"{{{', '.join(sorted(f'{canonical(k)}: {canonical(v)}' for k, v in value.items()))}}}"
    if isinstance(value, list | tuple):
        return f"{type(value).__name__}({', '.join(map(canonical, value))})"
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, PurePath):
        return f"path({value.as_posix()!r})"
    if isinstance(value, np.generic):
        return canonical(value.item())
    if isinstance(value, int | float | str | date | time):
        return repr(value)
    raise TypeError(f"a {type(value).__name__} has no canonical text")


@dataclass(frozen=True)
class Fingerprint:
    """Everything that the outputs of a task depend on."""

    inputs: dict[str, str]  # file -> sha256
    given: dict[str, str]  # argument of the stage other than records -> sha256
    settings: dict[str, Any]
    schemas: dict[str, str]  # kind of record read or made -> sha256 of its declaration
    code: dict[str, str]  # module -> sha256
    version: str


def differences(then: dict[str, Any], now: Fingerprint) -> list[str]:
    """Descriptions of the changes from the fingerprint of an entry to the present one."""
    if then == vars(now):
        return []
    changed = []
    if then.get("version") != now.version:
        changed.append(f"version {then.get('version')} became {now.version}")
    old = then.get("settings", {})
    changed += [f"{k} = {old.get(k)!r} became {v!r}" for k, v in now.settings.items() if old.get(k) != v]
    for what, reason in REASONS.items():
        old, new = then.get(what, {}), getattr(now, what)
        changed += [reason.format(name) for name in sorted(old.keys() | new.keys()) if old.get(name) != new.get(name)]
    return changed


@cache
def schemas(step: str) -> dict[str, str]:
    """The hash of the declaration of each kind of record that a step reads or makes."""
    asks = declaration(step)
    hashes = {kind.__name__: _hash(kind, _as_read) for kind in asks.reads}
    return hashes | {kind.__name__: _hash(kind, _as_written) for kind in asks.makes}


def _hash(kind: type[Record], describe: Callable[[str, Any], tuple[str, ...]]) -> str:
    columns = [describe(f.name, f.type) for f in fields(kind)]  # type: ignore[arg-type]
    return hash_of((kind.__name__, kind.KEY, kind.UNKNOWN, columns))


def _as_read(name: str, type_: Any) -> tuple[str, ...]:
    """What a reader of a field depends on: its name, type and unit."""
    stored = str(np.dtype(COLUMN_DTYPES[type_])) if type_ in COLUMN_DTYPES else str(type_)
    return name, stored, QUANTITIES[name].unit


def _as_written(name: str, type_: Any) -> tuple[str, ...]:
    """What the writer of a field depends on: also the meaning of a column, which is in the file."""
    meaning = (QUANTITIES[name].meaning,) if type_ in COLUMN_DTYPES else ()
    return *_as_read(name, type_), *meaning
