"""What a step knows of the records that it reads and writes, by hash: their declarations, not the code of those."""

from collections.abc import Callable
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from davinci_forces.records import COLUMN_DTYPES, Record
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.runner.fingerprints.canonical import hash_of
from davinci_forces.runner.signature import declaration


@cache
def schemas(step: str) -> dict[str, str]:
    """The hash of the declaration of each kind of record that a step reads or makes."""
    asks = declaration(step)
    hashes = {kind.__name__: _hash(kind, _as_read) for kind in asks.reads}
    return hashes | {kind.__name__: _hash(kind, _as_written) for kind in asks.makes}


def _hash(kind: type[Record], described: Callable[[str, Any], tuple[str, ...]]) -> str:
    declared = [described(f.name, f.type) for f in fields(kind)]  # type: ignore[arg-type]
    return hash_of((kind.__name__, kind.KEY, kind.UNKNOWN, declared))


def _as_read(name: str, type_: Any) -> tuple[str, ...]:
    """What a reader relies on of a field: its name, type and unit."""
    stored = str(np.dtype(COLUMN_DTYPES[type_])) if type_ in COLUMN_DTYPES else str(type_)
    return name, stored, QUANTITIES[name].unit


def _as_written(name: str, type_: Any) -> tuple[str, ...]:
    """All that a file holds of a field: the meaning of a column, too."""
    meaning = (QUANTITIES[name].meaning,) if type_ in COLUMN_DTYPES else ()
    return *_as_read(name, type_), *meaning
