"""Whether a study's files and numbers are still those that its results were made from."""

import json
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import store
from pipeline.errors import NotReproduced, PipelineError
from pipeline.ledger import Folders, Ledger
from pipeline.records import KINDS, Fit, Record
from pipeline.report.results import parse


@dataclass(frozen=True)
class Verified:
    """How much was compared."""

    raw: int
    processed: int
    reports: int
    numbers: int


def verify(folders: Folders) -> Verified:
    """Hash every file that the ledger names, and follow every number of results.json to its record.

    Raises
    ------
    NotReproduced
        With every file and number that is not what it was, one a line.
    """
    ledger = Ledger(folders)
    said: dict[str, str] = {}
    for entry in ledger.entries():
        said |= {**entry.fingerprint["inputs"], **entry.outputs}
    broken = [f"{file} was altered: it is not as a stage wrote it" for file in ledger.broken()]
    if not said and not broken:
        raise NotReproduced(f"{folders.processed} holds no results; run `davinci-forces all {folders.raw}` first")
    problems = broken + list(altered(folders, ledger, said))
    results, unreadable = numbers(folders)
    problems += unreadable if results is None else [p for r in results for p in differences(folders, r)]
    problems += unknown(folders, said)
    if problems:
        raise NotReproduced("\n".join(problems))
    count = {root: sum(name.startswith(f"{root}/") for name in said) for root in ("raw", "processed", "reports")}
    return Verified(**count, numbers=len(results or []))


def altered(folders: Folders, ledger: Ledger, said: dict[str, str]) -> Iterator[str]:
    """Files whose content is not what was hashed when they were read or made."""
    for name, sha in sorted(said.items()):
        file = folders.file(name)
        if not file.is_file():
            yield f"{file} is gone"
        elif ledger.digest(name) != sha:
            yield f"{file} was altered: its SHA-256 is {ledger.digest(name)[:16]}..., and was {sha[:16]}..."


def unknown(folders: Folders, said: dict[str, str]) -> list[str]:
    """Processed files that no stage made."""
    files = (f for f in sorted(folders.processed.rglob("*.parquet")))
    names = ((f, f"processed/{f.relative_to(folders.processed).as_posix()}") for f in files)
    return [f"{file} was made by no stage of this study" for file, name in names if name not in said]


def numbers(folders: Folders) -> tuple[list[dict[str, Any]] | None, list[str]]:
    """The content of results.json, or what is wrong with it."""
    file = folders.reports / "results.json"
    try:
        results = json.loads(file.read_text(encoding="utf-8"))
        return [dict(result) for result in results], []
    except FileNotFoundError:
        return None, [f"{file} is gone"]
    except (ValueError, TypeError) as error:
        return None, [f"{file} cannot be read: {error}"]


def differences(folders: Folders, result: dict[str, Any]) -> Iterator[str]:
    """Whether a result is what its source says."""
    name = f"{folders.reports / 'results.json'}: {result.get('key')}"
    try:
        if result["source"].startswith("raw/truth.toml#"):
            yield from of_truth(folders, result, name)
            return
        file, field, row = parse(result["source"])
        place = Path(file).relative_to("processed")
        record = store.read(KINDS[_kind(place)], folders.processed, place)
        value = cell(record, field, row)
        if result["value"] != value:
            yield f"{name}: says {result['value']!r}, but {result['source']} holds {value!r}"
        assert record.origin is not None
        if result["sha256"] != record.origin.sha256:
            yield f"{name}: {file} is not the file that it came from"
    except (PipelineError, KeyError, AttributeError, ValueError, IndexError) as error:
        yield f"{name}: cannot be followed to its source {result.get('source')!r}: {error}"


def of_truth(folders: Folders, result: dict[str, Any], name: str) -> Iterator[str]:
    """Whether a number of the truth is what truth.toml says."""
    value: Any = tomllib.loads((folders.raw / "truth.toml").read_text(encoding="utf-8"))
    for step in json.loads(result["source"].partition("#")[2]):
        value = value[step]
    if result["value"] != value:
        yield f"{name}: says {result['value']!r}, but {result['source']} holds {value!r}"
    if result["sha256"] != store.digest(folders.raw / "truth.toml"):
        yield f"{name}: truth.toml is not the file that it came from"


def cell(record: Record, field: str, row: str) -> float:
    """A scalar of a record, or one row of a column."""
    value = getattr(record, field)
    if not row:
        return float(value)
    if isinstance(value, tuple):
        return float(value[int(row)])
    labels = record.parameter if isinstance(record, Fit) else getattr(record, "link")  # noqa: B009 - the rows' names
    return float(value[int(np.flatnonzero(labels == row)[0])])


def _kind(place: Path) -> str:
    return next(name for name in KINDS if name.lower() == place.parts[0])
