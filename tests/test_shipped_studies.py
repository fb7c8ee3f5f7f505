"""The analyses of public recordings that ship without them: each runs on its files, and is passed over without them."""

import json
import shutil
import tomllib

import pytest

from davinci_forces.simulation.scenario.reading import load
from davinci_forces.simulation.study_folder import study_text
from tests.conftest import ROOT
from tests.test_robustness import flat
from tests.test_runs import call

PUBLIC = {"dvrk-psm": "dvrk_wpi", "dvrk-psm-2": "dvrk_slide", "palpation": "palpation", "ur10e": "ur10e"}


def test_all_passes_over_each_in_one_line_while_its_recordings_are_absent(tmp_path, monkeypatch):
    for name in PUBLIC:
        shutil.copytree(ROOT / "raw" / name, tmp_path / "raw" / name, ignore=shutil.ignore_patterns("*.csv"))
    monkeypatch.chdir(tmp_path)
    said = call("all")
    assert len(said.splitlines()) == len(PUBLIC)
    for name in PUBLIC:
        assert f"raw/{name}: skipped, its logs are missing" in said
        assert "get them" in flat((ROOT / "raw" / name / "study.toml").read_text().replace("#", "")).lower()


def test_all_passes_over_the_thesis_until_it_is_simulated_and_prints_the_command(tmp_path, monkeypatch):
    text = (ROOT / "raw" / "davinci-thesis" / "study.toml").read_text()
    assert text == study_text(load("davinci-thesis"))
    study = tmp_path / "raw" / "davinci-thesis"
    study.mkdir(parents=True)
    (study / "study.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    (said,) = call("all").splitlines()
    assert said.startswith("raw/davinci-thesis: skipped, its logs are missing")
    assert "`davinci-forces simulate davinci-thesis raw/davinci-thesis`" in said
    assert [file.name for file in study.iterdir()] == ["study.toml"]


def test_no_recording_ships():
    ignored = (ROOT / ".gitignore").read_text().splitlines()
    for name in PUBLIC:
        assert f"raw/{name}/*.csv" in ignored
    assert {"raw/davinci-thesis/*.tdms", "raw/davinci-thesis/truth.toml"} <= set(ignored)
    assert {log.file.rpartition(".")[2] for log in load("davinci-thesis").logs} == {"tdms"}


@pytest.fixture(scope="module")
def analysed(data, tmp_path_factory):
    """Analyse a shipped study on the recordings; its results by key, and what was said."""
    made = {}

    def analyse(name):
        if name not in made:
            study = tmp_path_factory.mktemp(name) / "raw" / name
            shutil.copytree(ROOT / "raw" / name, study)
            for log in tomllib.loads((study / "study.toml").read_text())["log"]:
                (study / log["file"]).symlink_to(data / PUBLIC[name] / log["file"])
            said = call("all", study)
            file = study.parent.parent / "reports" / name / "results.json"
            made[name] = {r["key"]: r for r in json.loads(file.read_text())}, said
        return made[name]

    return analyse


@pytest.mark.slow
def test_the_stiffness_of_the_phantom_is_that_of_a_line_through_its_probes(analysed):
    results, _ = analysed("palpation")
    assert results["tissue.probes.stiffness"]["value"] == pytest.approx(453, rel=0.05)
    assert "tissue.continuous.stiffness" in results


@pytest.mark.slow
def test_the_band_of_the_second_arm_covers_a_path_that_was_not_fitted(analysed):
    results, _ = analysed("dvrk-psm-2")
    coverage = results["effort.slide.instrument_slide.coverage"]
    assert coverage["value"] > 0.9
    # One log hardly tells how far the model's error differs from log to log, so its band is rather too wide.
    assert coverage["value"] - 1.96 * coverage["std"] < 0.98


@pytest.mark.slow
def test_the_shoulder_of_the_ur10e_repeats_every_ten_seconds_and_is_in_amperes(analysed):
    results, said = analysed("ur10e")
    assert results["period.joint-1"]["value"] == pytest.approx(10.0, abs=0.002)
    assert results["fit.shoulder_pan.independent.lse.coulomb_friction"]["unit"] == "A"
    assert "fault of davinci-forces" not in said
