"""The thesis chapter by chapter: no empty row, names that exist, and numbers that differ for a reason only."""

import re

import numpy as np
import pytest

import davinci_forces
from davinci_forces import commands
from davinci_forces.records import KINDS
from davinci_forces.robots.robot import Robot
from davinci_forces.runner import ALL
from davinci_forces.simulation import thesis
from tests.conftest import ROOT
from tests.test_cli import call

ROWS = [row for chapter in thesis.chapters() for row in chapter.rows]
CODE = re.compile(r"`([^`]+)`")
NOT_HERE = (
    "photograph",
    "drawing",
    "textbook",
    "block diagram",
    "screenshot",
    "this page",
    "figure of robot.html",
    "robot.html",
)
KEYS = (ROOT / "pipeline/davinci_forces/guide/reference/results.md").read_text(encoding="utf-8")


def test_every_numbered_table_and_figure_has_one_row():
    items = " ".join(row.item for row in ROWS)
    assert all(f"Table {c}.{i}" in items for c, n in {3: 1, 4: 2, 5: 4, 6: 6, 7: 1}.items() for i in range(1, n + 1))
    figures = {1: 2, 2: 5, 3: 5, 4: 6, 5: 6, 6: 21, 7: 12, 8: 12, 9: 6}
    expected = {f"{chapter}.{i}" for chapter, n in figures.items() for i in range(1, n + 1)}
    named = []
    for ranges in re.findall(r"Fig ([\d., -]+)", items):
        for chapter, first, last in re.findall(r"(\d)\.(\d+)(?:-\d\.(\d+))?", ranges):
            named += [f"{chapter}.{i}" for i in range(int(first), int(last or first) + 1)]
    assert sorted(named) == sorted(expected)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.item)
def test_no_row_is_empty_and_what_it_names_exists(row):
    assert row.shows
    assert row.here
    codes = CODE.findall(row.here)
    assert codes or any(word in row.here for word in NOT_HERE) or row.here.startswith("section on")
    for code in codes:
        if code.startswith("davinci-forces "):
            assert code.split()[1] in (*commands.COMMANDS, *ALL)
        elif method := re.match(r'robot\("davinci"\)\.(\w+)\(', code):
            assert hasattr(Robot, method[1])
        elif code in KINDS or code == "direct" or code.startswith(("scale", "law")):
            continue
        else:  # a result key, as the guide names it
            family = code.split(".")[0]
            assert f"`{family}." in KEYS or family in ("direct", "ekf-euler")


def test_printed_numbers_that_follow_from_the_thesis_are_found_or_differ_for_a_reason():
    compared = thesis.numbers({})
    for x in compared:
        assert len(x.printed) == len(x.here), x.name
        assert bool(x.why) == bool(x.differ.any()) or np.isnan(x.here).all(), x.name
    assert sum(len(x.printed) for x in compared) > 250
    assert sum(int((~np.isnan(x.here)).sum()) for x in compared) > 200


@pytest.mark.parametrize(
    ("item", "name", "differ"),
    [
        ("Table 6.1", "hand roll: a0 a1 b1 a2 b2 T", [2]),
        ("Table 6.1", "instrument slide: a0 a1 b1 a2 b2 T", [0]),
        ("Eq 6.10-6.12", "of m6 lc6, m7 lc7, m8 lc8, m9 lc9", [0, 1, 2]),
        ("Eq 6.59-6.60, Table 6.5", "MSE of guess, wlse, lse, pso", [0, 1]),
        ("Eq 6.57-6.58, Table 6.4", "guess", [0]),
    ],
)
def test_exactly_the_misprints_differ(item, name, differ):
    [x] = [x for x in thesis.numbers({}) if (x.item, x.name) == (item, name)]
    assert np.flatnonzero(x.differ).tolist() == differ


def test_fitted_parameters_come_from_results_and_agree_within_two_standard_errors():
    results = {"fit.hand_roll.independent.lse.viscous_friction": (0.39, 0.01)}
    [x] = [x for x in thesis.numbers(results) if x.item.endswith("Table 6.4") and x.name == "lse"]
    assert x.here[2] == 0.39
    assert not x.differ.any()
    [x] = [
        x
        for x in thesis.numbers({next(iter(results)): (0.40, 0.01)})
        if x.item.endswith("Table 6.4") and x.name == "lse"
    ]
    assert x.differ.tolist() == [False, False, True, False]


def test_the_command_prints_the_index_and_refuses_another_robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed = call("robot", "davinci", "--thesis")
    assert "Table 6.1" in printed
    assert "b1 is a misprint" in printed
    assert "not dvrk_psm" in call("robot", "dvrk_psm", "--thesis", code=1)
    assert davinci_forces.robot("davinci").name == "davinci"
