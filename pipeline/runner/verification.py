"""Whether a study's files and numbers are still those that its results were made from."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.errors import NotReproduced, PipelineError
from pipeline.records import KINDS, Record, store
from pipeline.records.catalogue import Catalogue
from pipeline.report.results import Results, cell, collect, parse_source
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
    recorded: dict[str, dict[str, str]] = {}
    for entry in ledger.entries():
        for name, sha in (*entry.fingerprint["inputs"].items(), *entry.outputs.items()):
            recorded.setdefault(name, {}).setdefault(sha, f"{entry.stage} {entry.task}")
    broken = [f"{file} was altered: it is not as a stage wrote it" for file in ledger.broken()]
    if not recorded and not broken:
        raise NotReproduced(f"{folders.processed} holds no results; run `davinci-forces all {folders.raw}` first")
    problems = broken + list(altered_files(folders, ledger, recorded))
    results, unreadable = read_results(folders)
    problems += unreadable if results is None else [p for r in results for p in source_mismatches(folders, r)]
    problems += unrecorded_files(folders, recorded)
    if results is not None:
        problems += record_mismatches(folders, results, collect(Catalogue(partial(records, folders, recorded))))
    if problems:
        raise NotReproduced("\n".join(problems))
    present = [name for name in recorded if ledger.digest(name)]
    count = {root: sum(name.startswith(f"{root}/") for name in present) for root in ("raw", "processed", "reports")}
    return Verified(**count, numbers=len(results or []))


def altered_files(folders: Folders, ledger: Ledger, recorded: dict[str, dict[str, str]]) -> Iterator[str]:
    """Files whose content is not what was hashed when they were read or made, by each task that did."""
    for name, hashes in sorted(recorded.items()):
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


def unrecorded_files(folders: Folders, recorded: dict[str, dict[str, str]]) -> list[str]:
    """Processed files that no stage made."""
    files = (f for f in sorted(folders.processed.rglob("*.parquet")))
    names = ((f, f"processed/{f.relative_to(folders.processed).as_posix()}") for f in files)
    return [f"{file} was made by no stage of this study" for file, name in names if name not in recorded]


def read_results(folders: Folders) -> tuple[list[dict[str, Any]] | None, list[str]]:
    """The content of results.json, or what is wrong with it."""
    file = folders.reports / "results.json"
    try:
        results = json.loads(file.read_text(encoding="utf-8"))
        return [dict(result) for result in results], []
    except FileNotFoundError:
        return None, [f"{file} is gone"]
    except (ValueError, TypeError) as error:
        return None, [f"{file} cannot be read: {error}"]


def records(folders: Folders, recorded: Iterable[str], kind: type[Record]) -> list[Record]:
    """Every record of a kind that a stage made; one that cannot be read was altered, which is reported elsewhere."""
    readable = []
    for name in sorted(recorded):
        if name.startswith(f"processed/{kind.folder()}/"):
            with suppress(PipelineError):
                readable.append(store.read(kind, folders.processed, Path(name).relative_to("processed")))
    return readable


def record_mismatches(folders: Folders, results: list[dict[str, Any]], collected: Results) -> Iterator[str]:
    """Results whose standard error or unit is not what the records give, and results that are not there."""
    keys = {str(result.get("key")) for result in results}
    place = folders.reports / "results.json"
    yield from (f"{place}: {key} is gone" for key in collected if key not in keys)
    for result in results:
        key = str(result.get("key"))
        # A true parameter has the unit of its estimates, and no standard error.
        group, _, parameter = key.removeprefix("truth.").rpartition(".")
        estimates = [k for k in collected if k.startswith(f"fit.{group}.") and k.endswith(f".{parameter}")]
        if key in collected:
            std, unit = collected[key].std, collected[key].unit
        elif key.startswith("truth.") and estimates:
            std, unit = None, collected[estimates[0]].unit
        else:
            continue
        for name, value in (("std", std), ("unit", unit)):
            if result.get(name) != value:
                yield f"{place}: {key}: says {name} {result.get(name)!r}, but its records give {value!r}"


def source_mismatches(folders: Folders, result: dict[str, Any]) -> Iterator[str]:
    """What of a result is not what its source holds."""
    name = f"{folders.reports / 'results.json'}: {result.get('key')}"
    try:
        if result["source"].startswith("raw/truth.toml#"):
            yield from truth_mismatches(folders, result, name)
            return
        file, field, row = parse_source(result["source"])
        place = Path(file).relative_to("processed")
        record = store.read(KINDS[_kind(place)], folders.processed, place)
        value, _ = cell(record, field, record.row_number(row) if row else None)
        if result["value"] != value:
            yield f"{name}: says {result['value']!r}, but {result['source']} holds {value!r}"
        assert record.origin is not None
        if result["sha256"] != record.origin.sha256:
            yield f"{name}: {file} is not the file that it came from"
    except (PipelineError, LookupError, AttributeError, TypeError, ValueError, OSError) as error:
        yield f"{name}: cannot be followed to its source {result.get('source')!r}: {error}"


def truth_mismatches(folders: Folders, result: dict[str, Any], name: str) -> Iterator[str]:
    """What of a true value is not what truth.toml holds."""
    value: Any = tomllib.loads((folders.raw / "truth.toml").read_text(encoding="utf-8"))
    for step in json.loads(result["source"].partition("#")[2]):
        value = value[step]
    if result["value"] != value:
        yield f"{name}: says {result['value']!r}, but {result['source']} holds {value!r}"
    if result["sha256"] != store.digest(folders.raw / "truth.toml"):
        yield f"{name}: truth.toml is not the file that it came from"


def _kind(place: Path) -> str:
    return {kind.folder(): name for name, kind in KINDS.items()}[place.parts[0]]
