"""The analyses of public recordings that ship without them: each runs on its files, and is passed over without them.

That of the phantom runs in tissue/test_tissue_logs.py.
"""

import shutil
import tomllib

import pytest

import davinci_forces
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.simulation.study_folder import study_text
from tests.conftest import ROOT
from tests.test_robustness import flat
from tests.test_runs import call

PUBLIC = {"dvrk-psm": "dvrk_wpi", "dvrk-psm-2": "dvrk_slide", "palpation": "palpation", "ur10e": "ur10e"}


def test_all_passes_over_them_in_one_line_while_their_recordings_are_absent(tmp_path, monkeypatch):
    for name in PUBLIC:
        shutil.copytree(ROOT / "raw" / name, tmp_path / "raw" / name, ignore=shutil.ignore_patterns("*.csv"))
    monkeypatch.chdir(tmp_path)
    said = call("all")
    names = ", ".join(f"raw/{name}" for name in sorted(PUBLIC))
    assert said.splitlines() == [
        f"{names}: skipped, as none of their logs is here; the study.toml of each says where to get them"
    ]
    for name in PUBLIC:
        assert "get them" in flat((ROOT / "raw" / name / "study.toml").read_text().replace("#", "")).lower()


def test_all_passes_over_the_thesis_until_it_is_simulated_and_prints_the_command(tmp_path, monkeypatch):
    text = (ROOT / "raw" / "davinci-thesis" / "study.toml").read_text()
    assert text == study_text(load("davinci-thesis"))
    study = tmp_path / "raw" / "davinci-thesis"
    study.mkdir(parents=True)
    (study / "study.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    (said,) = call("all").splitlines()
    assert said.startswith("raw/davinci-thesis: skipped, as none of its logs is here")
    assert "`davinci-forces simulate davinci-thesis raw/davinci-thesis`" in said
    assert [file.name for file in study.iterdir()] == ["study.toml"]


def test_no_recording_ships():
    ignored = (ROOT / ".gitignore").read_text().splitlines()
    for name in PUBLIC:
        assert f"raw/{name}/*.csv" in ignored
    assert {"raw/davinci-thesis/*.tdms", "raw/davinci-thesis/truth.toml"} <= set(ignored)
    assert {log.file.rpartition(".")[2] for log in load("davinci-thesis").logs} == {"tdms"}


def analysed(name, stage, data, home):
    """Copy a shipped study to the recordings and run a stage, with those before it."""
    study = home / "raw" / name
    shutil.copytree(ROOT / "raw" / name, study)
    for log in tomllib.loads((study / "study.toml").read_text())["log"]:
        (study / log["file"]).symlink_to(data / PUBLIC[name] / log["file"])
    call(stage, study)
    return study


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_search")
def test_the_band_of_the_second_arm_covers_a_path_that_was_not_fitted(data, tmp_path):
    found = davinci_forces.read(analysed("dvrk-psm-2", "assess", data, tmp_path), "FreeSpace", log="slide")
    row = found[(found["joint"] == "instrument_slide") & (found["filter"] == "rts")].iloc[0]
    assert row["coverage"] > 0.9
    # One log hardly tells how far the model's error differs from log to log, so its band is rather too wide.
    assert row["coverage"] - 1.96 * row["coverage_std"] < 0.98
