"""Records as pandas DataFrames, for people who go on from where the pipeline ends."""

from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.errors import BadRequest, MissingRecord
from pipeline.records import KINDS, Record, store
from pipeline.runner.ledger import Ledger
from pipeline.runner.runs import folders


def read(study: Path, kind: str, about: dict[str, str]) -> pd.DataFrame:
    """All records of a kind, one below the other; see `pipeline.read`."""
    if kind not in KINDS:
        raise BadRequest(f"there is no record {kind!r}; there are {', '.join(KINDS)}")
    unknown = set(about) - set(KINDS[kind].scalars())
    if unknown:
        raise BadRequest(f"{kind} has no {', '.join(sorted(unknown))}; it has {', '.join(KINDS[kind].scalars())}")
    places = folders(study, None, None)
    made = sorted({name for entry in Ledger(places).entries() for name in entry.outputs})
    folder = f"processed/{KINDS[kind].folder()}/"
    mine = [Path(name).relative_to("processed") for name in made if name.startswith(folder)]
    records = [store.read(KINDS[kind], places.processed, place) for place in mine]
    records = [r for r in records if all(str(getattr(r, k)) == v for k, v in about.items())]
    if not records:
        raise MissingRecord(
            f"{study} has no {kind} records{f' with {about}' if about else ''}; run `davinci-forces all {study}`"
        )
    frame = pd.concat([as_frame(record) for record in records], ignore_index=True)
    for name in KINDS[kind].KEY:
        frame[name] = frame[name].astype("category")
    frame.attrs["units"] = units(records)
    return frame


def as_frame(record: Record) -> pd.DataFrame:
    """One record, its key and single scalars repeated on every row."""
    scalars = {name: getattr(record, name) for name in record.scalars()}
    repeated = {name: value for name, value in scalars.items() if not isinstance(value, tuple)}
    columns = {name: getattr(record, name) for name in record.columns()}
    return pd.DataFrame({**{k: [v] * len(record) for k, v in repeated.items()}, **columns})


def units(records: list[Any]) -> dict[str, str | dict[str, str]]:
    """The unit of each field; by joint where joints differ."""
    found: dict[str, dict[str, str]] = {}
    for record in records:
        for name, unit in record.origin.units.items():
            found.setdefault(name, {})[getattr(record, "joint", getattr(record, "group", ""))] = unit
    return {name: of if len(set(of.values())) > 1 else next(iter(of.values())) for name, of in found.items()}
