"""Whether a study's files and numbers are still those that its results were made from."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import NotReproduced, PipelineError
from pipeline.records import KINDS, Fit, Record, store
from pipeline.records.catalogue import Catalogue
from pipeline.report.results import Results, collect, parse
from pipeline.runner.ledger import Folders, Ledger


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
    said: dict[str, dict[str, str]] = {}
    for entry in ledger.entries():
        for name, sha in (*entry.fingerprint["inputs"].items(), *entry.outputs.items()):
            said.setdefault(name, {}).setdefault(sha, f"{entry.stage} {entry.task}")
    broken = [f"{file} was altered: it is not as a stage wrote it" for file in ledger.broken()]
    if not said and not broken:
        raise NotReproduced(f"{folders.processed} holds no results; run `davinci-forces all {folders.raw}` first")
    problems = broken + list(altered(folders, ledger, said))
    results, unreadable = numbers(folders)
    problems += unreadable if results is None else [p for r in results for p in differences(folders, r)]
    problems += strangers(folders, said)
    if results is not None:
        problems += misstated(folders, results, collect(Catalogue(partial(records, folders, said))))
    if problems:
        raise NotReproduced("\n".join(problems))
    there = [name for name in said if ledger.digest(name)]
    count = {root: sum(name.startswith(f"{root}/") for name in there) for root in ("raw", "processed", "reports")}
    return Verified(**count, numbers=len(results or []))


def altered(folders: Folders, ledger: Ledger, said: dict[str, dict[str, str]]) -> Iterator[str]:
    """Files whose content is not what was hashed when they were read or made, by each task that did."""
    for name, hashes in sorted(said.items()):
        file, now = folders.file(name), ledger.digest(name)
        if not now and any(hashes):
            yield f"{file} is gone"
            continue
        for was, task in hashes.items():
            if now == was:
                continue
            if not was:
                yield f"{file} is there now, and was not for {task}"
            else:
                yield f"{file} was altered: its SHA-256 is {now[:16]}..., and was {was[:16]}... for {task}"


def strangers(folders: Folders, said: dict[str, dict[str, str]]) -> list[str]:
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


def records(folders: Folders, said: Iterable[str], kind: type[Record]) -> list[Record]:
    """Every record of a kind that a stage made; one that cannot be read was altered, which is said elsewhere."""
    found = []
    for name in sorted(said):
        if name.startswith(f"processed/{kind.folder()}/"):
            with suppress(PipelineError):
                found.append(store.read(kind, folders.processed, Path(name).relative_to("processed")))
    return found


def misstated(folders: Folders, results: list[dict[str, Any]], found: Results) -> Iterator[str]:
    """Results whose deviation or unit is not what the records give, and results that are not there."""
    keys = {str(result.get("key")) for result in results}
    place = folders.reports / "results.json"
    yield from (f"{place}: {key} is gone" for key in found if key not in keys)
    for result in results:
        key = str(result.get("key"))
        # The truth has the unit of what was found, and no deviation.
        group, _, parameter = key.removeprefix("truth.").rpartition(".")
        beside = [k for k in found if k.startswith(f"fit.{group}.") and k.endswith(f".{parameter}")]
        if key in found:
            std, unit = found[key].std, found[key].unit
        elif key.startswith("truth.") and beside:
            std, unit = None, found[beside[0]].unit
        else:
            continue
        for word, value in (("std", std), ("unit", unit)):
            if result.get(word) != value:
                yield f"{place}: {key}: says {word} {result.get(word)!r}, but its records give {value!r}"


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
    except (PipelineError, LookupError, AttributeError, TypeError, ValueError, OSError) as error:
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
    return {kind.folder(): name for name, kind in KINDS.items()}[place.parts[0]]
