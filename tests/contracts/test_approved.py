"""The small study gives the numbers, the remarks and the pages that were looked at and approved.

The other tests say what is right.  This one says what has changed: `make approve` writes what there is now, and the
differences that the commit then shows are to be explained by it.  Numbers are compared within a millionth and a
thousandth of their standard error, so that another processor changes none.
"""

import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from davinci_forces.records import KINDS, Diagnostic, Record
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.report.content import Number
from davinci_forces.report.results import collect
from davinci_forces.report.sections import SECTIONS
from tests.contracts.conftest import Lab
from tests.contracts.test_sections import context, written

APPROVED = Path(__file__).with_name("approved")
SHARE, SHARE_OF_RECORDS, SHARE_OF_STD = 1e-6, 1e-5, 1e-3
ROWS = 4  # of a table that are compared


def outline(x: Any, name: str = "") -> Iterator[str]:
    """A page as lines: words, numbers as they are printed, and of curves the number of points and their range."""
    if isinstance(x, Number):
        yield f"{name}{x} {x.key or ''}".rstrip()
    elif is_dataclass(x):
        yield f"{name}{type(x).__name__}"
        for field in fields(x):
            value = getattr(x, field.name)
            if value is not None and not (isinstance(value, str | tuple) and len(value) == 0):
                yield from (f" {line}" for line in outline(value, f"{field.name}: "))
    elif isinstance(x, np.ndarray):
        yield f"{name}{span(x)}"
    elif isinstance(x, tuple | list) and all(isinstance(part, str | int | float) for part in x):
        yield f"{name}{' | '.join(f'{part:.4g}' if isinstance(part, float) else str(part) for part in x)}"
    elif isinstance(x, tuple | list):
        yield f"{name}{len(x)}"
        for part in x[:ROWS] if name == "rows: " else x:
            yield from (f" {line}" for line in outline(part))
    else:
        yield f"{name}{x:.4g}" if isinstance(x, float) else f"{name}{x}"


def span(x: np.ndarray) -> str:
    """The shape of an array, and its range to three digits."""
    numbers = x[np.isfinite(x)] if x.dtype.kind in "fiu" else x[:0]
    return f"{x.shape}" + (f" {numbers.min():.3g} to {numbers.max():.3g}" if numbers.size else "")


@pytest.fixture(scope="module")
def pages(lab: Lab, catalogue: Catalogue) -> str:
    about = context(lab, catalogue)
    sections = (written(name, about) for name in SECTIONS if name != "provenance")
    return "\n".join(line for section in sections if section for line in outline(section)) + "\n"


def share_of(key: str, otherwise: float) -> float:
    """The share within which numbers under a key agree on every processor.

    Steps of an adaptive solver follow the last digits of the dynamics, and a filter whose noise follows its own
    innovations amplifies rounding.
    """
    return 0.05 if "-adaptive" in key else 1e-4 if key.startswith(("control.", "lyapunov.")) else otherwise


def compare(file: str, now: str, approve: bool) -> str:
    """What was approved; now, if it is to be."""
    place = APPROVED / file
    if approve:
        place.write_text(now, encoding="utf-8")
    return place.read_text(encoding="utf-8")


def test_numbers_are_those_that_were_approved(catalogue: Catalogue, pytestconfig: pytest.Config):
    results = {key: [r.value, r.std] for key, r in collect(catalogue).items()}
    lines = [f'"{key}": {json.dumps([x and float(f"{x:.9g}") for x in pair])}' for key, pair in results.items()]
    now = "{\n" + ",\n".join(lines) + "\n}\n"
    approved = json.loads(compare("numbers.json", now, pytestconfig.getoption("--approve")))
    assert list(results) == list(approved)
    changed = {}
    for key, (value, std) in results.items():
        share = share_of(key, SHARE)
        was, was_std = approved[key]
        near = share * abs(was) + SHARE_OF_STD * (was_std or 0.0) + 1e-12
        if not abs(value - was) <= near and not (np.isnan(value) and np.isnan(was)):
            changed[key] = (value, was)
        elif (std is None) != (was_std is None) or (
            std and not abs(std - was_std) <= max(share, SHARE_OF_STD) * was_std
        ):
            changed[key] = (std, was_std)
    assert not changed


def sizes(record: Record) -> Iterator[tuple[str, list[float]]]:
    """The mean and the root mean square of each field of a record that holds numbers."""
    for name in (*record.scalars(), *record.columns()):
        value = getattr(record, name)
        if not isinstance(value, int | float | tuple | np.ndarray) or (x := np.asarray(value)).dtype.kind not in "fiub":
            continue
        x = x[np.isfinite(x)].astype(float)
        if x.size:
            yield name, [float(x.mean()), float(np.sqrt((x**2).mean()))]


def test_records_are_those_that_were_approved(catalogue: Catalogue, pytestconfig: pytest.Config):
    numbers: dict[str, list[list[float]]] = {}
    for kind in KINDS.values():
        for record in catalogue.records(kind):
            adaptive = "-adaptive" if "ekf-adaptive" in record.key else ""
            for name, pair in sizes(record):
                numbers.setdefault(f"{kind.folder()}{adaptive}.{name}", []).append(pair)
    lines = [f'"{key}": {[[float(f"{x:.7g}") for x in pair] for pair in pairs]}' for key, pairs in numbers.items()]
    approved = json.loads(
        compare("records.json", "{\n" + ",\n".join(lines) + "\n}\n", pytestconfig.getoption("--approve"))
    )
    assert {key: len(pairs) for key, pairs in numbers.items()} == {key: len(pairs) for key, pairs in approved.items()}
    changed = {}
    for key, pairs in numbers.items():
        share = share_of(key, SHARE_OF_RECORDS)
        for (mean, rms), (was_mean, was_rms) in zip(pairs, approved[key], strict=True):
            if max(abs(mean - was_mean), abs(rms - was_rms)) > share * was_rms + 1e-12:
                changed[key] = (mean, rms), (was_mean, was_rms)
    assert not changed


def test_remarks_are_those_that_were_approved(catalogue: Catalogue, pytestconfig: pytest.Config):
    remarks = sorted((d.stage, d.subject, *map(str, d.text)) for d in catalogue.records(Diagnostic))
    now = "\n".join(" | ".join(remark) for remark in remarks) + "\n"
    assert now.splitlines() == compare("remarks.txt", now, pytestconfig.getoption("--approve")).splitlines()


def test_pages_are_those_that_were_approved(pages: str, pytestconfig: pytest.Config):
    assert pages.splitlines() == compare("pages.txt", pages, pytestconfig.getoption("--approve")).splitlines()
