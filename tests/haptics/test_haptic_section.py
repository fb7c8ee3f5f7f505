"""What the report says of a simulated hand: stable or not, where its limit is, and when it touched the tissue."""

from dataclasses import fields

import numpy as np
import pytest

from davinci_forces.records import HapticResponse, HapticRun, Origin, Record
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report.content import Figure, OnScreen, Section, Table, Verdict, VSpan, walk
from davinci_forces.report.context import Context
from davinci_forces.report.results import collect
from davinci_forces.report.sections import haptics
from davinci_forces.robots import davinci
from davinci_forces.study import Settings, Study

NAN = float("nan")
T = np.arange(1000) / 100.0
UNITS = {"k_t_settles": "N/m", "felt_error": "N"}


def run(**about) -> HapticRun:
    values = dict.fromkeys(HapticRun.scalars(), 1.0) | dict.fromkeys(HapticRun.columns(), np.zeros(1000))
    values |= {"hand": "firm", "out_of_reach": 0, "t": T, "k_t_settles": 900.0, "stiffness_margin": 2.0}
    return read(HapticRun(**(values | {"true_force": np.maximum(np.sin(T), 0.0)} | about)))


def read(record: Record) -> Record:
    units = {f.name: UNITS.get(f.name, "") for f in fields(record)}
    object.__setattr__(record, "origin", Origin("x.parquet", "0" * 64, units))
    return record


def written(*records: Record) -> Section | None:
    catalogue = Catalogue(lambda kind: [record for record in records if isinstance(record, kind)])
    study = Study(None, "A study", davinci.ROBOT, True, Settings(), ())
    return haptics.section(Context(catalogue, study, collect(catalogue), Provenance("study", "1", {}, {}, {}, {})))


@pytest.mark.parametrize(
    ("about", "level", "words"),
    [
        ({}, "good", "measured tissue. It settles against tissue up to 900 N/m, 2.0 times the measured stiffness"),
        ({"k_t_settles": NAN, "stiffness_margin": NAN, "delay_margin": NAN}, "good", "No limit of the tissue's"),
        ({"delay_margin": 0.0}, "warn", "within reach, but is **unstable** when it stays in the tissue"),
        ({"out_of_reach": 1}, "warn", "**unstable** against the measured tissue: it leaves the device's reach at 10"),
    ],
)
def test_a_hand_is_said_to_be_stable_or_not_and_where_its_limit_is(about, level, words):
    [verdict] = [block for block in walk(written(run(**about))) if isinstance(block, Verdict)]
    assert verdict.level == level
    assert words in verdict.text
    assert "**Simulated**" in verdict.text


def test_contact_is_shaded_where_the_arm_presses():
    spans = [mark for mark in haptics.spans(run()) if isinstance(mark, VSpan)]
    assert [(span.start, span.end) for span in spans] == [(0.01, 3.15), (6.29, 9.43)]


def test_all_but_the_verdicts_is_on_screen_only_and_says_that_it_is_simulated():
    section = written(run(), read(HapticResponse("davinci", "the thesis", *[1.0] * 5, *[np.ones(3)] * 3)))
    assert [type(block) for block in section.blocks] == [Verdict, OnScreen]
    folded = section.blocks[-1]
    shown = [block for block in walk(folded) if isinstance(block, Figure | Table)]
    assert len(shown) == 3
    assert all("imulated" in block.caption for block in shown)


def test_without_a_run_there_is_no_section():
    assert written() is None
