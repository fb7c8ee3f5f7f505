"""Joints whose drive's gain is not known: effort is the motor's current, in A, and so is all that is said of it."""

import json
from dataclasses import replace

import numpy as np
import pytest

import davinci_forces
from davinci_forces.identification.candidates import coupled_joints, share_parameters
from davinci_forces.robots.dvrk_psm import ROBOT
from davinci_forces.robots.models import coupled_arm
from tests import arm
from tests.test_runs import call

MOTOR = "gear_ratio = 100.0\ntorque_constant = 0.05\n"
PUSHING = "N m", "kg"
UNKNOWN = replace(ROBOT, joints=(replace(ROBOT.joints[0], effort="A"), *ROBOT.joints[1:]))


@pytest.fixture(scope="module")
def in_current(tmp_path_factory):
    """The arm of the tests, of whose roll only the current is known; its motor's angle is logged beyond the gears."""
    study = arm.write_study(tmp_path_factory.mktemp("lab") / "raw" / "arm")
    robot = (study / "arm.toml").read_text()
    (study / "arm.toml").write_text(robot.replace(MOTOR, 'gear_ratio = 100.0\neffort = "A"\n', 1))
    text = (study / "study.toml").read_text()
    (study / "study.toml").write_text(text.replace('"hand_roll.tau" = ', '"hand_roll.i" = '))
    call("all", study)
    return study


@pytest.mark.medium
def test_a_current_is_taken_as_it_is_whatever_the_gears(in_current):
    recording = davinci_forces.read(in_current, "Recording", log="roll")
    logged = np.loadtxt(in_current / "roll.csv", delimiter=",", skiprows=1)[:, 3]
    np.testing.assert_array_equal(recording["tau"], logged)
    assert recording.attrs["units"]["tau"] == "A"


@pytest.mark.medium
def test_nothing_that_is_said_of_the_joint_is_in_units_of_a_push(in_current):
    results = json.loads((in_current.parent.parent / "reports" / "arm" / "results.json").read_text())
    own = {r["key"]: r["unit"] for r in results if ".hand_roll." in r["key"]}
    assert {key: unit for key, unit in own.items() if any(u in unit for u in PUSHING)} == {}
    assert own["fit.hand_roll.independent.lse.inertia"] == "A s^2/rad"
    assert own["fit.hand_roll.independent.lse.gravity_sine"] == "A s^2/m"
    assert own["fit.hand_roll.independent.lse.mse"] == "A^2"
    assert own["ekf.push.hand_roll.tau_ext_rms"] == "A"
    slide = {r["key"]: r["unit"] for r in results if ".instrument_slide." in r["key"]}
    assert slide["fit.instrument_slide.independent.lse.inertia"] == "kg"


@pytest.mark.medium
def test_the_report_says_that_no_torque_constant_is_known(in_current):
    page = (in_current.parent.parent / "reports" / "arm" / "report.html").read_text()
    assert "motor current [A] where the torque constant is unknown" in page
    assert "external effort [A]" in page


@pytest.mark.medium
def test_a_unit_of_torque_is_refused_for_a_current(in_current, tmp_path):
    study = arm.write_study(tmp_path / "raw" / "arm")
    (study / "arm.toml").write_text((in_current / "arm.toml").read_text())
    text = (study / "study.toml").read_text()
    (study / "study.toml").write_text(
        text.replace(
            '"hand_roll.tau" = "hand_roll.tau"', '"hand_roll.tau" = { channel = "hand_roll.tau", unit = "N m" }'
        )
    )
    assert "'N m' measures torque, but current is needed" in " ".join(call("ingest", study, code=1).split())


def test_links_seen_through_a_drive_are_in_their_units_times_its_gain():
    model = coupled_arm(UNKNOWN, [0], [()], group="hand_roll")
    units = {p.name.partition(" of ")[0]: p.unit for p in model.parameters}
    assert units["Ixx"] == "kg m^2 A/(N m)"
    assert units["Coulomb friction"] == "A"


def test_joints_share_no_parameters_with_one_whose_gain_is_not_known():
    assert share_parameters(ROBOT, [0, 1, 2])
    assert share_parameters(UNKNOWN, [1, 2])
    assert not share_parameters(UNKNOWN, [0, 1, 2])
    assert not share_parameters(ROBOT, [1])
    names = [joint.name for joint in ROBOT.joints]
    groups = [coupled_joints(ROBOT, rows, dict.fromkeys(names, ())).group for rows in ([1], [0, 1, 2])]
    assert groups == [names[1], "arm"]
