"""Two small studies give the numbers, the remarks and the pages that were looked at and approved.

The other tests say what is right.  This one says what has changed: `make approve` writes what there is now, and the
differences that the commit then shows are to be explained by it.  Numbers are compared within a millionth and a
thousandth of their standard error, so that another processor changes none.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from itertools import starmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from davinci_forces.records import KINDS, Diagnostic, Fit, Record
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.report.content import Number
from davinci_forces.report.context import Context
from davinci_forces.report.results import Results, collect
from davinci_forces.report.sections import SECTIONS
from tests.contracts.conftest import Lab
from tests.contracts.test_sections import context, written

APPROVED = Path(__file__).with_name("approved")
SHARE, SHARE_OF_RECORDS, SHARE_OF_STD, SHARE_OF_CURVES = 1e-6, 1e-5, 1e-3, 1e-3
TIE = 0.02  # [s], the sampling time of these studies: two samples may have the same peak but for rounding
SENTENCE = re.compile(r"^( *(text|items|caption|alt|title): |\S)")  # the lines of a paragraph begin at the margin
CURVE = re.compile(r"^( *[\w: ]*\([\d, ]+\)) (.*)$")


def outline(x: Any, name: str = "") -> Iterator[str]:
    """A page as lines: words, rows of tables with numbers as they are printed, and a summary of each curve."""
    if isinstance(x, Number):
        yield f"{name}{x} {x.key or ''} {x.digits}{'' if x.least is None else f' {x.least:g}'}"
    elif name == "rows: ":
        yield f"{name}{len(x)}"
        yield from (" " + " | ".join(line for cell in row for line in outline(cell)) for row in x)
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
        for part in x:
            yield from (f" {line}" for line in outline(part))
    else:
        yield f"{name}{x:.4g}" if isinstance(x, float) else f"{name}{x}"


def span(x: np.ndarray) -> str:
    """The shape of an array, and its mean, its root mean square and its range."""
    numbers = x[np.isfinite(x)].astype(float) if x.dtype.kind in "fiub" else np.empty(0)
    if not numbers.size:
        return f"{x.shape}"
    summary = (numbers.mean(), np.sqrt((numbers**2).mean()), numbers.min(), numbers.max())
    return f"{x.shape} {' '.join(f'{number:.5g}' for number in summary)}"


def same_line(line: str, approved: str) -> bool:
    """Whether lines of a page are the same; curves are within a share of their root mean square."""
    now, before = CURVE.match(line), CURVE.match(approved)
    if line == approved or not (now and before) or now[1] != before[1]:
        return line == approved
    numbers, approved_numbers = np.array(now[2].split(), float), np.array(before[2].split(), float)
    return bool(np.all(np.abs(numbers - approved_numbers) <= SHARE_OF_CURVES * approved_numbers[1]))


class Small(NamedTuple):
    """What a study gave, and the folder of what was approved of it."""

    lab: Lab
    catalogue: Catalogue
    approved: Path


@pytest.fixture(scope="module", params=["", "faulty_"])
def study(request: pytest.FixtureRequest) -> Small:
    lab, catalogue = (request.getfixturevalue(f"{request.param}{name}") for name in ("lab", "catalogue"))
    return Small(lab, catalogue, APPROVED / request.param.rstrip("_"))


def pages_of(about: Context) -> str:
    sections = (written(name, about) for name in SECTIONS)
    return "\n".join(line for section in sections if section for line in outline(section)) + "\n"


@pytest.fixture(scope="module")
def pages(study: Small) -> str:
    return pages_of(context(study.lab, study.catalogue))


def without_errors(study: Small) -> Context:
    """The study as if no number had a standard error."""
    about = context(study.lab, study.catalogue)
    results = Results({key: replace(result, std=None) for key, result in about.results.items()})
    return replace(about, results=results)


def of_one_joint(study: Small) -> Context:
    """The study as if it was one joint with one fit by itself, which moves in its first log and in its first test."""
    [joint, *_], logs = study.lab.study.robot.joints, study.lab.study.logs
    names = {next(log.name for log in logs if log.role == role) for role in ("identification", "validation")}

    def is_of_it(record: Record) -> bool:
        if isinstance(record, Fit) and (record.model, record.estimator) not in (("independent", "lse"), *chosen):
            return False
        log, name = (getattr(record, field, default) for field, default in (("log", ""), ("joint", joint.name)))
        return log in {"", *names} and name == getattr(record, "group", joint.name) == joint.name

    chosen = [(fit.model, fit.estimator) for fit in study.catalogue.records(Fit) if fit.model != "independent"]
    catalogue = Catalogue(lambda kind: [record for record in study.catalogue.records(kind) if is_of_it(record)])
    return context(study.lab, catalogue)


def share_of(key: str, otherwise: float) -> float:
    """The share within which numbers under a key agree on every processor.

    Steps of an adaptive solver follow the last digits of the dynamics, and a filter whose noise follows its own
    innovations amplifies rounding.
    """
    return 0.05 if "-adaptive" in key else 1e-4 if key.startswith(("control.", "lyapunov.")) else otherwise


def rounding_of(key: str) -> float:
    """What rounding makes of a number under a key in any unit: a peak may be one sample later."""
    return 1.01 * TIE if key.endswith("push_delay") else 1e-12


def compare(place: Path, now: str, approve: bool) -> str:
    """What was approved; now, if it is to be."""
    if approve:
        place.write_text(now, encoding="utf-8")
    return place.read_text(encoding="utf-8")


def test_numbers_are_those_that_were_approved(catalogue: Catalogue, pytestconfig: pytest.Config):
    results = {key: [r.value, r.std] for key, r in collect(catalogue).items()}
    lines = [f'"{key}": {json.dumps([x and float(f"{x:.9g}") for x in pair])}' for key, pair in results.items()]
    now = "{\n" + ",\n".join(lines) + "\n}\n"
    approved = json.loads(compare(APPROVED / "numbers.json", now, pytestconfig.getoption("--approve")))
    assert list(results) == list(approved)
    changed = {}
    for key, (value, std) in results.items():
        share = share_of(key, SHARE)
        was, was_std = approved[key]
        near = share * abs(was) + SHARE_OF_STD * (was_std or 0.0) + rounding_of(key)
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


def test_records_are_those_that_were_approved(study: Small, pytestconfig: pytest.Config):
    numbers: dict[str, list[list[float]]] = {}
    for kind in KINDS.values():
        for record in study.catalogue.records(kind):
            adaptive = "-adaptive" if "ekf-adaptive" in record.key else ""
            for name, pair in sizes(record):
                numbers.setdefault(f"{kind.folder()}{adaptive}.{name}", []).append(pair)
    lines = [f'"{key}": {[[float(f"{x:.7g}") for x in pair] for pair in pairs]}' for key, pairs in numbers.items()]
    approved = json.loads(
        compare(
            study.approved / "records.json", "{\n" + ",\n".join(lines) + "\n}\n", pytestconfig.getoption("--approve")
        )
    )
    assert {key: len(pairs) for key, pairs in numbers.items()} == {key: len(pairs) for key, pairs in approved.items()}
    changed = {}
    for key, pairs in numbers.items():
        share = share_of(key, SHARE_OF_RECORDS)
        for (mean, rms), (was_mean, was_rms) in zip(pairs, approved[key], strict=True):
            if max(abs(mean - was_mean), abs(rms - was_rms)) > share * was_rms + rounding_of(key):
                changed[key] = (mean, rms), (was_mean, was_rms)
    assert not changed


def test_remarks_are_those_that_were_approved(study: Small, pytestconfig: pytest.Config):
    remarks = sorted((d.stage, d.subject, *map(str, d.text)) for d in study.catalogue.records(Diagnostic))
    now = "\n".join(" | ".join(remark) for remark in remarks) + "\n"
    assert (
        now.splitlines()
        == compare(study.approved / "remarks.txt", now, pytestconfig.getoption("--approve")).splitlines()
    )


def test_pages_are_those_that_were_approved(study: Small, pages: str, pytestconfig: pytest.Config):
    assert_same_lines(pages, compare(study.approved / "pages.txt", pages, pytestconfig.getoption("--approve")))


@pytest.mark.parametrize("part", [without_errors, of_one_joint])
def test_sentences_about_less_are_those_that_were_approved(
    part: Callable[[Small], Context], study: Small, pages: str, pytestconfig: pytest.Config
):
    whole = set(pages.splitlines())
    sentences = (line for line in pages_of(part(study)).splitlines() if SENTENCE.match(line))
    other = "\n".join(line for line in sentences if line not in whole) + "\n"
    approved = compare(study.approved / f"{part.__name__}.txt", other, pytestconfig.getoption("--approve"))
    assert_same_lines(other, approved)


def assert_same_lines(text: str, approved: str) -> None:
    lines, before = text.splitlines(), approved.splitlines()
    if len(lines) != len(before) or not all(starmap(same_line, zip(lines, before, strict=True))):
        assert lines == before
