"""What the report says of a simulated hand, and when it touched the tissue."""

from dataclasses import fields

import numpy as np

from davinci_forces.records import HapticResponse, HapticRun, Origin, Record
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report.content import Figure, Listing, OnScreen, Prose, Section, walk
from davinci_forces.report.content.marks import VSpan
from davinci_forces.report.context import Context
from davinci_forces.report.results import collect
from davinci_forces.report.sections import haptics
from davinci_forces.robots import davinci
from davinci_forces.study import Settings, Study

T = np.arange(1000) / 100.0
UNITS = {"felt_error": "N"}


def run(**about) -> HapticRun:
    values = dict.fromkeys(HapticRun.scalars(), 1.0) | dict.fromkeys(HapticRun.columns(), np.zeros(1000))
    values |= {"hand": "firm", "out_of_reach": 0, "t": T}
    return read(HapticRun(**(values | {"true_force": np.maximum(np.sin(T), 0.0)} | about)))


def read(record: Record) -> Record:
    units = {f.name: UNITS.get(f.name, "") for f in fields(record)}
    object.__setattr__(record, "origin", Origin("x.parquet", "0" * 64, units))
    return record


def context(*records: Record) -> Context:
    catalogue = Catalogue(lambda kind: [record for record in records if isinstance(record, kind)])
    study = Study(None, "A study", davinci.ROBOT, True, Settings(), ())
    return Context(catalogue, study, collect(catalogue), Provenance("study", "1", {}, {}, {}, {}))


def written(*records: Record) -> Section | None:
    return haptics.section(context(*records))


def test_contact_is_shaded_where_the_arm_presses():
    figures = [haptics.traces(context(each), each) for each in (run(), run(true_force=np.maximum(T - 5.0, 0.0)))]
    spans, [last] = ([m for m in figure.panels[1].marks if isinstance(m, VSpan)] for figure in figures)
    assert [(span.start, span.end) for span in spans] == [(0.01, 3.14), (6.29, 9.42)]
    assert (last.start, last.end) == (5.01, 9.99)  # to the last sample


def test_figures_are_on_screen_only_and_all_say_that_they_are_simulated():
    lines = "[arm]\ntick = 1e-4"
    section = written(run(), read(HapticResponse("davinci", "the thesis", lines, *[1.0] * 5, *[np.ones(3)] * 3)))
    assert [type(block) for block in section.blocks] == [Prose, OnScreen, OnScreen]
    assert [block.text for block in walk(section.blocks[1]) if isinstance(block, Listing)] == [lines]
    assert "This is **simulated**, not recorded" in section.blocks[0].text
    folded = section.blocks[-1]
    shown = [block for block in walk(folded) if isinstance(block, Figure)]
    assert len(shown) == 2
    assert all("imulated" in block.caption for block in shown)


def test_without_a_run_there_is_no_section():
    assert written() is None
