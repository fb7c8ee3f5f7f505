"""A study of bags that hold what a simulated study recorded gives that study's results."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.simulation import study_folder
from davinci_forces.simulation.scenario.reading import load
from tests.conftest import TWO_FRICTIONS
from tests.contracts.conftest import shorten
from tests.logs.bag_writer import joint_state, write

LOGS = ("matched-roll-excitation", "matched-roll-validation", "matched-roll-contact", "matched-slide-excitation")
BAGS = dict(zip(LOGS, ("one.bag", "two", "three_mcap", "four.bag"), strict=True))
TOLERANCE = 1e-6  # relative; times are rounded to nanoseconds


def simulated(folder: Path) -> dict[str, str]:
    """The text of each [[log]] of a study that is simulated in the folder; of the excitations the first 40 s."""
    scenario = load(TWO_FRICTIONS)
    logs = tuple(replace(log, duration=min(log.duration, 40.0)) for log in scenario.logs if log.name in LOGS)
    study_folder.write(replace(scenario, logs=logs), folder, False, lambda _: None)
    _, *tables = re.split(r"^\[\[log\]\]\n", (folder / "study.toml").read_text(), flags=re.M)
    return {re.search(r'name = "(.*)"', table)[1]: table for table in tables}


def study(folder: Path, tables: dict[str, str]) -> Path:
    folder.mkdir(parents=True)
    head = 'title = "T"\nrobot = "davinci"\n'
    (folder / "study.toml").write_text(head + "".join(f"[[log]]\n{table}\n" for table in tables.values()))
    return folder


def results(folder: Path) -> dict[str, float]:
    assert davinci_forces.run(folder, quiet=True)
    home = folder.parents[1] / "reports" / folder.name / "results.json"
    beginning = ("fit.", "predict.", "ekf.")
    return {r["key"]: r["value"] for r in json.loads(home.read_text()) if r["key"].startswith(beginning)}


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_once", "coarse_search")
def test_bags_of_a_study_s_recordings_give_its_results(tmp_path, monkeypatch):
    shorten(monkeypatch)  # what is designed depends on no log
    tables = simulated(tmp_path / "simulated")
    whole = study(tmp_path / "raw" / "whole", {n: re.sub(r"skip = .*\n", "", t) for n, t in tables.items()})
    original = study(tmp_path / "raw" / "original", tables)
    for table in tables.values():
        file = re.search(r'file = "(.*)"', table)[1]
        for folder in (whole, original):
            shutil.copy(tmp_path / "simulated" / file, folder)
    assert davinci_forces.run(whole, "ingest", quiet=True)
    of_bags = {}
    for name, table in tables.items():
        of_bags[name] = table.partition("[log.channels]")[0] + "[log.channels]\n"
        of_bags[name] = re.sub(r'file = ".*"', f'file = "{BAGS[name]}"', of_bags[name])
        for joint in dict.fromkeys(re.findall(r'^"(\w+)\.', table, flags=re.M)):
            for symbol, state in (("q", "position"), ("dq", "velocity"), ("tau", "effort")):
                of_bags[name] += f'"{joint}.{symbol}" = "/arm/measured_js/{state}[{joint}]"\n'
    bags = study(tmp_path / "raw" / "bags", of_bags)
    for name, file in BAGS.items():
        recorded = davinci_forces.read(whole, "Recording", log=name)
        joints = list(dict.fromkeys(recorded["joint"]))
        columns = {
            c: np.column_stack([recorded.loc[recorded["joint"] == j, c] for j in joints]) for c in ["q", "dq", "tau"]
        }
        t = recorded.loc[recorded["joint"] == joints[0], "t"]
        states = zip(t, columns["q"], columns["dq"], columns["tau"], strict=True)
        write(bags / file, (joint_state(s, joints, *state, topic="/arm/measured_js") for s, *state in states))
    expected, got = results(original), results(bags)
    # Of the stages that were not run, verify says so; of the folder that is a log, that it was altered.
    metadata = bags / "two" / "metadata.yaml"
    assert "metadata.yaml" not in CliRunner().invoke(app, ["verify", str(bags)]).output
    metadata.write_text(metadata.read_text() + "\n")
    assert "raw/two/metadata.yaml" in CliRunner().invoke(app, ["verify", str(bags)]).output
    assert "two/metadata.yaml" in (tmp_path / "reports" / "bags" / "report.html").read_text()
    assert set(got) == set(expected)
    assert {key.partition(".")[0] for key in got} == {"fit", "predict", "ekf"}
    for key, value in expected.items():
        assert got[key] == pytest.approx(value, rel=TOLERANCE, abs=0, nan_ok=True), key
