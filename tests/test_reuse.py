"""What another study has made of the same is copied, and only that."""

from dataclasses import asdict, replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.runner.fingerprint import Fingerprint, hash_of_text
from davinci_forces.runner.ledger import Entry, Folders, Ledger
from davinci_forces.runner.plan import Task, reuse
from davinci_forces.stages import design

SAME = Fingerprint({}, {"robot": "a"}, {"shape": [1, 2]}, {}, {"design.py": "b"}, "1")
LINKS, POSE = "processed/links/arm.parquet", "processed/pose/arm.parquet"


def ledger(lab: Path, study: str) -> Ledger:
    return Ledger(Folders(lab / "raw" / study, lab / "processed" / study, lab / "reports" / study))


def make(lab: Path, study: str, fingerprint: Fingerprint, failed: str = "", **files: str) -> Ledger:
    made = ledger(lab, study)
    for name, text in files.items():
        file = made.folders.file(f"processed/{name}/arm.parquet")
        file.parent.mkdir(parents=True)
        file.write_text(text)
    hashes = {f"processed/{name}/arm.parquet": hash_of_text(text) for name, text in files.items()}
    made.write(Entry("design", "design", asdict(fingerprint), hashes, failed))
    return made


def test_files_and_entry_of_the_same_task_are_copied_and_what_was_there_before_goes(tmp_path):
    there = make(tmp_path, "one", SAME, links="the links")
    here = make(tmp_path, "two", replace(SAME, version="0"), pose="an old pose")
    assert reuse(here, Task("design", "design", SAME)) == "one"
    assert here.folders.file(LINKS).read_text() == "the links"
    assert not here.folders.file(POSE).exists()
    assert here.entry("design", "design") == there.entry("design", "design")
    assert not here.reasons(here.entry("design", "design"), SAME)


@pytest.mark.parametrize(
    ("fingerprint", "failed", "altered"),
    [
        (replace(SAME, given={"robot": "another"}), "", False),
        (replace(SAME, settings={"shape": [1, 3]}), "", False),
        (replace(SAME, code={"design.py": "new"}), "", False),
        (SAME, "it failed", False),
        (SAME, "", True),
    ],
)
def test_what_differs_or_failed_or_was_altered_is_not_copied(tmp_path, fingerprint, failed, altered):
    there = make(tmp_path, "one", fingerprint, failed, links="the links")
    if altered:
        there.folders.file(LINKS).write_text("other links")
    here = ledger(tmp_path, "two")
    assert reuse(here, Task("design", "design", SAME)) == ""
    assert here.entry("design", "design") is None


def test_a_task_that_reads_something_of_its_study_is_never_copied(tmp_path):
    fingerprint = replace(SAME, inputs={"raw/log.csv": "c"})
    make(tmp_path, "one", fingerprint, links="the links")
    assert reuse(ledger(tmp_path, "two"), Task("design", "design", fingerprint)) == ""


def test_a_second_study_of_a_robot_copies_its_design_and_says_so_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(design, "control", lambda *_: iter(()))  # they take their time
    monkeypatch.setattr(design, "excitations", lambda _: iter(()))
    for study in ("one", "two"):
        (tmp_path / "raw" / study).mkdir(parents=True)
        (tmp_path / "raw" / study / "log.csv").write_text("time,q,tau\n0,0,0\n")
        (tmp_path / "raw" / study / "study.toml").write_text(STUDY)
    said = [CliRunner().invoke(app, ["design", str(tmp_path / "raw" / study)]).output for study in ("one", "two")]
    assert "copied" not in said[0]
    assert said[1].count("\n") == 2
    assert "design: copied from one, which has the same robot and settings" in said[1]
    files = [sorted((tmp_path / "processed" / study).rglob("*.*")) for study in ("one", "two")]
    assert [f.read_bytes() for f in files[0] if f.is_file()] == [f.read_bytes() for f in files[1] if f.is_file()]
    assert "1 of 1 up to date" in CliRunner().invoke(app, ["design", str(tmp_path / "raw" / "two")]).output
    forced = CliRunner().invoke(app, ["design", str(tmp_path / "raw" / "two"), "--force"]).output
    assert "copied" not in forced


STUDY = """
title = "A study"
robot = "davinci"
[[log]]
name = "log"
file = "log.csv"
role = "identification"
[log.channels]
time = "time"
"hand_roll.q" = "q"
"hand_roll.tau" = "tau"
"""
