"""Every number of a report under a stable key, with its source (results.json), and the report ID (manifest.txt)."""

import hashlib
import json
import math
import re
from dataclasses import asdict, dataclass

from davinci_forces.records import KINDS, Record
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.records.quantities import PER_ROW
from davinci_forces.records.record import Published
from davinci_forces.report.content.number import Number


@dataclass(frozen=True)
class Result:
    """One number: `source` is the record's file and the field, or the cell, that holds it."""

    key: str
    value: float
    std: float | None
    unit: str
    source: str
    sha256: str

    def number(self, digits: int = 4) -> Number:
        """The number as a report prints it."""
        return Number(self.value, format_unit(self.unit), self.std, self.key, digits)


class Results(dict[str, Result]):
    """Results by key, in the order in which they were collected."""

    def add(self, record: Record, number: Published) -> None:
        """Put a number of a record under its key, unless there is one already: joints of a log share some."""
        value, unit = cell(record, number.field, number.row)
        if number.key in self or not math.isfinite(value):
            return
        assert record.origin is not None
        std = cell(record, number.std, number.row)[0] if number.std else math.nan
        row = "" if number.row is None else f"[{record.row_name(number.row)}]"
        source = f"processed/{record.origin.path}#{number.field}{row}"
        self[number.key] = Result(
            number.key, value, std if math.isfinite(std) else None, unit, source, record.origin.sha256
        )

    def truth(self, key: str, value: float, unit: str, path: tuple[str, ...], sha256: str) -> None:
        """Put a number of a simulated study's ground truth under a key; `path` leads to it in truth.toml."""
        self[key] = Result(key, value, None, unit, f"raw/truth.toml#{json.dumps(path, ensure_ascii=False)}", sha256)

    def json(self) -> bytes:
        """The content of results.json."""
        text = json.dumps([asdict(result) for result in self.values()], indent=1, ensure_ascii=False, allow_nan=False)
        return (text + "\n").encode()


def collect(catalogue: Catalogue) -> Results:
    """Every number that a study's records publish."""
    results = Results()
    for kind in KINDS.values():
        if kind.published is Record.published:  # it has none, and may be large
            continue
        for record in catalogue.records(kind):
            for number in record.published():
                results.add(record, number)
    return results


def cell(record: Record, field: str, row: int | None) -> tuple[float, str]:
    """A scalar of a record, or one row of a column, with its unit; a row may have a unit of its own."""
    value = getattr(record, field)
    unit = record.origin.units.get(field, "") if record.origin else ""
    if row is None:
        return float(value), unit
    return float(value[row]), str(record.unit[row]) if unit == PER_ROW else unit  # type: ignore[attr-defined]


def format_unit(unit: str) -> str:
    """A unit as it is printed: powers as superscripts, a root as a root, and nothing for a pure number."""
    text = re.sub(r"(\w+)\^0\.5", r"√\1", "" if unit == "1" else unit)
    return re.sub(r"\^(\d)", lambda match: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(match[1])], text)


MANIFEST = "manifest.txt"


def manifest(provenance: Provenance, made: dict[str, bytes]) -> bytes:
    """Every file that a run reads and makes, pages apart, as `sha256sum --check` takes it.

    Names are `raw/<study>/...`, `processed/<study>/...` and `reports/<study>/...`, wherever these folders are; `made`
    are the files of the report that hold its numbers.
    """
    study = provenance.name
    files = {
        **provenance.raw,
        **{f"processed/{study}/{place}": sha for place, sha in provenance.processed.items()},
        **{f"reports/{study}/{name}": hashlib.sha256(content).hexdigest() for name, content in made.items()},
    }
    return "".join(f"{sha}  {name}\n" for name, sha in sorted(files.items()) if sha).encode()


def identity(listed: bytes) -> str:
    """The report ID: 128 bits of the sha256 of its manifest."""
    return hashlib.sha256(listed).hexdigest()[:32]
