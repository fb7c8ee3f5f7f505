"""The demonstration study: one arm, whose logs in git are its scenario's, and whose samples come late or early."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from davinci_forces.simulation.motion import simulate_log
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.simulation.study_folder import record_channels, study_text, truth_text
from davinci_forces.study import reading
from tests.conftest import ROOT

DEMO = ROOT / "raw" / "davinci-demo"
SCENARIO = load("davinci-demo")


def test_the_study_in_git_is_that_of_its_scenario():
    names = [(log.name, log.file, log.role) for log in SCENARIO.logs]
    assert [(entry.name, entry.files[0], entry.role) for entry in reading.read(DEMO).logs] == names
    assert {file.name for file in DEMO.iterdir()} == {"study.toml", "truth.toml", *(log.file for log in SCENARIO.logs)}
    assert (DEMO / "study.toml").read_text() == study_text(SCENARIO)
    assert (DEMO / "truth.toml").read_text().startswith(truth_text(SCENARIO, []))


def test_the_study_has_every_role_both_formats_and_all_joints_where_any_but_the_slide_moves():
    study = reading.read(DEMO)
    assert {entry.role for entry in study.logs} == {
        "identification", "validation", "contact", "weight", "friction", "tissue",
    }  # fmt: skip
    assert {file.rpartition(".")[2] for entry in study.logs for file in entry.files} == {"lvm", "tdms"}
    joints = {joint.name for joint in study.robot.joints}
    for entry, log in zip(study.logs, SCENARIO.logs, strict=True):
        recorded = {source.quantity.partition(".")[0] for source in entry.channels} - {"time"}
        assert recorded == (joints if log.role == "identification" or set(log.moves) != {"instrument_slide"}
                            else {"instrument_slide"})  # fmt: skip
    together = [log for log in SCENARIO.logs if log.role == "identification" and set(log.moves) == joints]
    assert together  # coupled models are among the candidates


def test_the_truth_tells_what_was_put_into_the_arm():
    truth = tomllib.loads((DEMO / "truth.toml").read_text())
    [family] = SCENARIO.arm.families
    for i, joint in enumerate(SCENARIO.robot.joints):
        friction = truth["friction"][family][joint.name]
        put_in = SCENARIO.arm.families[family].friction
        assert friction == {name: values[i] for name, values in put_in._asdict().items()}
    assert truth["clock_jitter"] == SCENARIO.clock_jitter
    assert truth["motors"]["inductance"] == SCENARIO.arm.motors.inductance.tolist()
    assert "theta" not in truth  # no joint's own model has such friction


def test_samples_are_late_or_early_by_the_jitter_and_all_joints_together():
    jitter = 4e-4
    log = next(log for log in SCENARIO.logs if log.name == "arm-validation")
    run = simulate_log(SCENARIO, log)
    exact, uneven = (
        {c.quantity: c.samples for c in record_channels(replace(SCENARIO, clock_jitter=value), log, run)}
        for value in (0.0, jitter)
    )
    late = []
    for name, motion in run.motions.items():
        fast = np.abs(motion.dq) > 0.5 * np.abs(motion.dq).max()
        shift = (uneven[f"{name}.theta_m"] - exact[f"{name}.theta_m"])[fast]
        gear = SCENARIO.robot.joint(name).gear_ratio
        late.append(np.where(fast, 0.0, np.nan))
        late[-1][fast] = shift / gear / motion.dq[fast]
        assert np.std(late[-1][fast]) == pytest.approx(jitter, rel=0.1)
    both = ~np.isnan(late[0]) & ~np.isnan(late[1])
    assert np.corrcoef(late[0][both], late[1][both])[0, 1] > 0.99
