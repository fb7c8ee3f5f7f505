"""Steps of stages: what one needs of the others, and what an earlier version called stages."""

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.runner.graph import every_step, required_steps
from davinci_forces.runner.ledger import Entry, Ledger
from davinci_forces.runner.runs import folders
from davinci_forces.runner.signature import stage_of, steps

FIT = ["ingest", "resample", "average", "differentiate", "fit", "fit.apply"]


@pytest.fixture
def finished(analysed, tmp_path) -> Path:
    """A copy of an analysed study, to be changed."""
    shutil.copytree(analysed.parent.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "raw" / "arm"


def test_a_stage_has_a_step_for_each_function_that_it_exports_in_their_order():
    assert steps("fit") == ("fit", "fit.apply")
    assert steps("tune") == ("tune", "tune.gather")
    assert steps("resolve") == ("resolve", "resolve.gather", "resolve.apply")


def test_a_stage_needs_the_steps_that_make_what_it_reads_and_no_other():
    assert required_steps(["fit"]) == FIT
    ekf = required_steps(["ekf"])
    assert {"tune.gather", "calibrate", "calibrate.gather", "predict"} <= {*ekf}
    assert not {"design", "choose.apply", "assess", "benchmark", "whiteness"} & {*ekf}
    assert ekf == [step for step in every_step() if step in ekf]


def test_a_group_needs_its_stages_whole_and_what_they_read():
    model = required_steps(["model"])
    assert model == [*FIT, "choose", "choose.apply", "predict", "predict.apply"]
    assert required_steps(["weigh"])[-2:] == ["weigh", "weigh.gather"]


def test_names_in_any_order_are_taken_in_that_of_the_stages_and_the_report_needs_everything():
    assert required_steps(["ekf", "fit"]) == required_steps(["ekf"])
    assert required_steps(["fit", "report"]) == [*every_step(), "report"]


def test_a_step_waits_for_those_before_it_and_says_the_name_of_its_stage(finished, capsys):
    ledger = Ledger(folders(finished, None, None))
    assert [stage_of(entry.stage) for entry in ledger.entries("tune.gather")] == ["tune"]
    ledger.place("tune", "roll/hand_roll").unlink()
    ledger.place("tune.gather", "gather").unlink()
    assert davinci_forces.run(finished, "tune")
    said = capsys.readouterr().out.splitlines()[1:]
    assert said == [
        "tune: roll/hand_roll: first run",
        "tune: gather: first run",
        "tune: 3 of 5 up to date",
    ]


def test_what_would_run_is_told_once_a_stage(finished):
    ledger = Ledger(folders(finished, None, None))
    ledger.place("tune", "check/hand_roll").unlink()  # which makes nothing, as it identifies nothing
    said = CliRunner().invoke(app, ["calibrate", str(finished), "--dry-run"]).output.splitlines()[1:]
    assert said == ["tune: check/hand_roll: would run: first run", "calibrate: waits for the results of tune"]
    said = CliRunner().invoke(app, ["tune", str(finished), "--dry-run"]).output.splitlines()[1:]
    assert said == ["tune: check/hand_roll: would run: first run", "tune: 4 of 5 up to date"]


@pytest.mark.parametrize(
    ("function", "subject"), [("tip.resolve.apply", "apply.push"), ("forces.tune.gather", "gather")]
)
def test_a_step_that_fails_leaves_a_diagnostic_that_is_its_own(finished, monkeypatch, capsys, function, subject):
    def fail(**_):
        raise ZeroDivisionError("for a test")

    monkeypatch.setattr(f"davinci_forces.stages.{function}", fail)
    _, stage, _ = function.split(".")
    assert not davinci_forces.run(finished, stage, force=True)
    assert f"{stage}: error: ZeroDivisionError: for a test" in capsys.readouterr().err
    made = {name for entry in Ledger(folders(finished, None, None)).entries() if entry.failed for name in entry.outputs}
    assert f"processed/diagnostic/{stage}/{subject}.parquet" in made


def test_what_was_made_under_the_name_of_a_stage_that_is_no_more_goes_and_is_made_anew(finished, capsys):
    ledger = Ledger(folders(finished, None, None))
    [entry] = ledger.entries("tune.gather")
    stray = "processed/filter_noise/old.parquet"
    shutil.copy(ledger.folders.file(next(iter(entry.outputs))), ledger.folders.file(stray))
    sha = ledger.digest(stray)
    ledger.write(Entry("settle", "settle", entry.fingerprint, {**entry.outputs, stray: sha}))
    ledger.place("tune.gather", "gather").unlink()
    assert json.loads(ledger.place("settle", "settle").read_text())["stage"] == "settle"
    assert davinci_forces.run(finished, "tune")
    assert "removed 3 files of settle, which an earlier version made" in capsys.readouterr().out
    assert not ledger.folders.file(stray).exists()
    assert not ledger.place("settle", "settle").parent.exists()
    assert all(ledger.folders.file(name).exists() for name in entry.outputs)
