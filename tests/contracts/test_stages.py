"""Every stage: a pure function that gets what its signature asks for, and makes what it says."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

import pytest
from numpy.testing import assert_array_equal

from davinci_forces.records import Diagnostic, Record, TorqueConstant
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report import report
from davinci_forces.runner import execution
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.plan import Task
from davinci_forces.runner.signature import declaration, function_of, steps
from davinci_forces.stages import STAGES, module
from tests.conftest import quick_limits
from tests.contracts.conftest import Lab, shorten

STEP = pytest.mark.parametrize("step", every_step())
MOST = 7  # parameters of a function of a stage: records, what the study says, and settings


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_says_what_it_does_and_exports_what_can_run(stage: str):
    assert import_module(module(stage)).__doc__
    assert stage in steps(stage)


@STEP
def test_the_declaration_parses_and_the_function_says_what_it_does(step: str):
    assert function_of(step).__doc__
    asks = declaration(step)
    groups = [asks.each, asks.per_log, asks.every]
    assert len(asks.each) <= 1  # of two, the runner could not tell how often to call it
    assert [parameter for group in groups for parameter, kinds in group.items() if not kinds] == []
    assert asks.makes


@STEP
def test_a_function_of_a_stage_asks_for_at_most_seven_things(step: str):
    assert len(signature(function_of(step)).parameters) <= MOST


def arguments(lab: Lab, task: Task) -> dict[str, Any]:
    """What the runner would hand to a step; records that cannot be written into."""
    handed = execution.arguments(lab.folders, task)
    handed |= {p: list(handed[p]) for p in task.records if isinstance(handed[p], execution.InTurn)}
    for record in [r for p in task.records for r in (handed[p] if isinstance(handed[p], list) else [handed[p]]) if r]:
        for column in record.columns():
            getattr(record, column).setflags(write=False)
    return handed


@contextmanager
def away(*there: Path) -> Iterator[None]:
    """Without these folders."""
    elsewhere = {folder: folder.with_name(f"{folder.name}.away") for folder in there if folder.exists()}
    for folder, gone in elsewhere.items():
        folder.rename(gone)
    try:
        yield
    finally:
        for folder, gone in elsewhere.items():
            gone.rename(folder)


def same(one: Record, other: Record) -> None:
    assert type(one) is type(other)
    for name in one.scalars():
        assert repr(getattr(one, name)) == repr(getattr(other, name)), f"{one}: {name}"
    for name in one.columns():
        assert_array_equal(getattr(one, name), getattr(other, name), err_msg=f"{one}: {name}")


@STEP
@pytest.mark.usefixtures("coarse_search")
def test_the_same_records_give_the_same_records_and_nothing_else_is_read(step: str, lab: Lab, monkeypatch):
    """Twice on the very same arguments, which stay as they are, and with the study's files moved away meanwhile."""
    shorten(monkeypatch)
    for name, value in quick_limits().items():
        monkeypatch.setattr(name, value)
    run, asks = function_of(step), declaration(step)
    files = [lab.folders.processed, *([] if "log" in asks.given.values() else [lab.study.folder])]
    made: Counter[tuple[str, ...]] = Counter()
    kinds: set[type[Record]] = set()
    for task in lab.plan.tasks(asks):
        handed = arguments(lab, task)
        with away(*files):
            first, second = (list(run(**handed)) for _ in range(2))
        for one, other in zip(first, second, strict=True):
            same(one, other)
        kinds |= {type(record) for record in first}
        made.update({(type(record).__name__, *record.key) for record in first})
    kinds |= {TorqueConstant} if step == "weigh.gather" else set()  # needs currents; tests/test_weighing.py has them
    assert kinds | {Diagnostic} == {*asks.makes, Diagnostic}
    assert [key for key, tasks in made.items() if tasks > 1] == []  # one would overwrite the other


def test_no_two_tasks_make_the_same_file(lab: Lab):
    """Nor do two steps of a stage say anything under one name: one would overwrite the other."""
    made = Counter(name for entry in lab.plan.ledger.entries() for name in entry.outputs)
    assert [name for name, tasks in made.items() if tasks > 1] == []


def test_the_report_of_the_same_records_is_the_same(lab: Lab, catalogue: Catalogue, monkeypatch):
    """Its numbers; the writers are slow, and `test_runs` compares what they write."""
    monkeypatch.setattr(report, "render_all", lambda documents: {})
    provenance = Provenance("lab", "1", {}, {}, {}, {})
    with away(lab.folders.processed, lab.study.folder):
        first, second = (report.write_report(catalogue, lab.study, provenance) for _ in range(2))
    assert first["results.json"] == second["results.json"]
    assert b'"fit.hand_roll.independent.lse.inertia"' in first["results.json"]
