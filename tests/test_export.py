"""The command `export`: what it writes, what it replaces, and what it refuses in one message."""

import json
import shutil
from pathlib import Path

import pytest

from davinci_forces.errors import NotAFile
from davinci_forces.exports import FORMATS
from davinci_forces.files import write_folder
from davinci_forces.runner.results import campaign
from davinci_forces.study.review import FILE
from tests.test_cli import call

REJECTED = f'[verdict]\nverdict = "reject"\nreviewer = "A. B."\nresults = "{"0" * 64}"\n'


@pytest.fixture
def finished(analysed, tmp_path) -> Path:
    """A copy of an analysed study, to be changed."""
    shutil.copytree(analysed.parent.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "raw" / "arm"


def one_message(output: str) -> str:
    [line] = [line for line in output.splitlines() if line.startswith("error: ")]
    return line


def test_an_export_is_a_folder_beside_whoever_asks_for_it(finished, monkeypatch):
    monkeypatch.chdir(finished.parent.parent)
    assert "see arm-json/model.json" in call("export", finished, "--to", "json")
    files = {file.name: file.read_bytes() for file in Path("arm-json").iterdir()}
    report_id = json.loads(files["model.json"])["report_id"]
    assert report_id in call("verify", finished, "--id", report_id)
    assert one_message(call("export", finished, "--to", "json", code=1)).endswith("--out names another folder")
    Path("arm-json/model.json").write_text("changed")
    call("export", finished, "--to", "json", "--replace")
    assert {file.name: file.read_bytes() for file in Path("arm-json").iterdir()} == files
    assert sorted(Path().iterdir()) == [Path(name) for name in ("arm-json", "processed", "raw", "reports")]


def test_a_folder_that_holds_anything_of_somebody_is_not_replaced(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "thesis.tex").write_text("work of years")
    with pytest.raises(NotAFile, match=r"it exists, and holds 'thesis\.tex'"):
        write_folder(folder, {"model.json": b"{}"}, True)
    link = tmp_path / "link"
    link.symlink_to(folder)
    with pytest.raises(NotAFile):
        write_folder(link, {"thesis.tex": b"{}"}, True)
    with pytest.raises(NotAFile, match="it exists"):
        write_folder(folder, {"thesis.tex": b"{}"})
    write_folder(folder, {"thesis.tex": b"{}", "more": b""}, True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link", "mine"]
    assert (folder / "thesis.tex").read_bytes() == b"{}"


def test_a_folder_is_written_whole_or_not_at_all(tmp_path):
    folder = tmp_path / "mine"
    write_folder(folder, {"a": b"1"})
    with pytest.raises(TypeError):
        write_folder(folder, {"a": b"2", "b": None}, True)
    assert [(p.name, p.read_bytes()) for p in folder.iterdir()] == [("a", b"1")]
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize("place", ["processed/arm-json", "reports/arm/deep", "raw/../processed"])
def test_an_export_never_lies_below_results(finished, place):
    out = finished.parent.parent / place
    assert "which holds results only" in one_message(call("export", finished, "--to", "json", "--out", out, code=1))


def test_what_cannot_be_exported_is_refused_in_one_message(finished, tmp_path):
    out = ("--out", tmp_path / "out")
    message = one_message(call("export", finished, "--to", "fmu", *out, code=1))
    assert message == f"error: there is no format 'fmu'; there are {', '.join(FORMATS)}"
    assert (
        one_message(call("export", finished, code=1))
        == f"error: write --to and a format; there are {', '.join(FORMATS)}"
    )
    message = one_message(call("export", finished, "--to", "json", "--joint", "elbow", *out, code=1))
    assert "has no joint 'elbow'; it has hand_roll" in message
    assert not (tmp_path / "out").exists()


def test_a_rejected_study_leaves_only_if_asked_twice_and_its_files_say_so(finished, tmp_path):
    (finished / FILE).write_text(REJECTED)
    out = tmp_path / "out"
    message = one_message(call("export", finished, "--to", "json", "--out", out, code=1))
    assert "study is rejected by A. B.; --despite-verdict exports it" in message
    assert not out.exists()
    call("export", finished, "--to", "json", "--out", out, "--despite-verdict")
    for file in out.iterdir():
        assert "exported despite: study is rejected by A. B." in file.read_text()


def test_a_problem_on_page_one_forbids_only_the_joint_that_has_it(finished, tmp_path, monkeypatch):
    joints = [{"joint": "hand_roll", "verdict": "bad"}, {"joint": "instrument_slide", "verdict": "good"}]
    monkeypatch.setattr(campaign, "read_summary", lambda file: {"joints": joints})
    message = one_message(call("export", finished, "--to", "json", "--out", tmp_path / "out", code=1))
    assert "joint hand_roll has the verdict Problem" in message
    call("export", finished, "--to", "json", "--out", tmp_path / "out", "--joint", "instrument_slide")
