"""Records and results as pandas DataFrames, for further analysis."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from davinci_forces.errors import BadRequest, MissingRecord
from davinci_forces.files import read_bytes
from davinci_forces.records import KINDS, Record, store
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.runs import folders

FIELDS = ("key", "value", "std", "unit", "source", "sha256")  # of a number in results.json


def read(study: Path, kind: str, selection: dict[str, object]) -> pd.DataFrame:
    """All records of a kind whose fields equal those of `selection`, in one DataFrame; see `davinci_forces.read`."""
    if kind not in KINDS:
        raise BadRequest(f"there is no kind of record {kind!r}; the kinds are {', '.join(KINDS)}")
    if unknown := set(selection) - set(KINDS[kind].scalars()):
        raise BadRequest(f"{kind} has no {', '.join(sorted(unknown))}; it has {', '.join(KINDS[kind].scalars())}")
    study_folders = folders(study, None, None)
    outputs = sorted({name for entry in Ledger(study_folders).entries() for name in entry.outputs})
    folder = f"processed/{KINDS[kind].folder()}/"
    files = [Path(name).relative_to("processed") for name in outputs if name.startswith(folder)]
    records = [store.read(KINDS[kind], study_folders.processed, file) for file in files]
    for key, value in selection.items():
        known = sorted({str(getattr(record, key)) for record in records})
        if known and str(value) not in known:
            raise BadRequest(f"{study} has no {kind} whose {key} is {value!r}; there are {', '.join(known)}")
        records = [record for record in records if str(getattr(record, key)) == str(value)]
    if not records:
        raise MissingRecord(f"{study} has no {kind} records; run `davinci-forces all {study}`")
    frame = pd.concat([as_frame(record) for record in records], ignore_index=True)
    for name in KINDS[kind].KEY:
        frame[name] = frame[name].astype("category")
    frame.attrs["units"] = units(records)
    return frame


def results(study: Path) -> pd.DataFrame:
    """All numbers of a study's results.json; see `davinci_forces.results`."""
    numbers = numbers_of(folders(study, None, None))
    frame = pd.DataFrame([*numbers.values()], columns=[*FIELDS[:-1], "std_reason"]).set_index("key")
    return frame.astype({"value": float, "std": float})


def numbers_of(places: Folders) -> dict[str, Mapping[str, Any]]:
    """The numbers of results.json by key, with `FIELDS` and `std_reason`; raises MissingRecord without intact ones."""
    file = places.reports / "results.json"
    try:
        rows = json.loads(read_bytes(file))
        return {r["key"]: {name: r[name] for name in FIELDS} | {"std_reason": r.get("std_reason")} for r in rows}
    except FileNotFoundError:
        raise MissingRecord(f"{file} does not exist; run `davinci-forces all {places.raw}`") from None
    except (ValueError, TypeError, LookupError) as error:
        advice = f"`davinci-forces report {places.raw}` writes it again"
        raise MissingRecord(f"{file} is not as the report wrote it ({error!r}); {advice}") from None


def as_frame(record: Record) -> pd.DataFrame:
    """A record as a DataFrame; its key and its single values (tuples left out) are repeated in every row."""
    scalars = {name: getattr(record, name) for name in record.scalars()}
    repeated = {name: value for name, value in scalars.items() if not isinstance(value, tuple)}
    columns = {name: getattr(record, name) for name in record.columns()}
    rows = len(record) if columns else 1
    return pd.DataFrame({**{k: [v] * rows for k, v in repeated.items()}, **columns})


def units(records: list[Any]) -> dict[str, str | dict[str, str]]:
    """Map each field to its unit; if units differ, to a dictionary from joint (or group) to unit."""
    units_of_field: dict[str, dict[str, str]] = {}
    for record in records:
        for name, unit in record.origin.units.items():
            units_of_field.setdefault(name, {})[getattr(record, "joint", getattr(record, "group", ""))] = unit
    return {
        name: by_joint if len(set(by_joint.values())) > 1 else next(iter(by_joint.values()))
        for name, by_joint in units_of_field.items()
    }
