"""Bags as a dVRK and a Franka record them, shown by inspect and analysed as a study."""

import json

import numpy as np
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from tests import arm
from tests.logs.bag_writer import Message, joint_state, write
from tests.logs.test_ros_messages import definitions

SIGNAL = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
ROWS = list(zip(SIGNAL.t, SIGNAL.q, SIGNAL.dq, SIGNAL.tau, strict=True))


def dvrk():
    """The measured and the commanded state, half a millisecond apart, and a picture now and then."""
    for i, (t, q, dq, tau) in enumerate(ROWS):
        yield joint_state(t, ["roll"], [q], [dq], [tau], topic="/PSM1/measured_js")
        yield joint_state(t + 5e-4, ["roll"], [q], [], [0.9 * tau], topic="/PSM1/setpoint_js")
        if i % 50 == 0:
            yield Message("/camera", "sensor_msgs/msg/CompressedImage", t, {"data": [1] * (400 + i)})


def shown(path) -> dict:
    done = CliRunner().invoke(app, ["inspect", str(path), "--json", "--head", "2"])
    assert done.exit_code == 0, done.output
    return json.loads(done.output)


def test_inspect_shows_both_states_of_a_dvrk_and_a_study_of_them_is_identified(tmp_path):
    folder = tmp_path / "raw" / "arm"
    folder.mkdir(parents=True)
    arm.write_robot(folder)
    about = shown(write(folder / "roll.bag", dvrk()))
    assert about["rows"] == len(ROWS)
    assert about["head"]["/PSM1/measured_js/effort[0]"] == SIGNAL.tau[:2].tolist()
    assert about["head"]["/PSM1/setpoint_js/effort[0]"] == (0.9 * SIGNAL.tau[:2]).tolist()
    assert "/camera" in about["facts"]["left out"]
    assert not about["warnings"]
    channels = '"hand_roll.q" = "/PSM1/measured_js/position[roll]"\n"hand_roll.dq" = "/PSM1/measured_js/velocity[0]"\n'
    channels += '"hand_roll.tau" = "/PSM1/measured_js/effort[roll]"\n'
    entry = f'[[log]]\nname = "roll"\nfile = "roll.bag"\nrole = "identification"\n\n[log.channels]\n{channels}'
    (folder / "study.toml").write_text(f'title = "T"\nrobot = "arm.toml"\n{entry}')
    assert davinci_forces.run(folder, "fit", quiet=True)
    recorded = davinci_forces.read(folder, "Recording")
    np.testing.assert_array_equal(recorded["tau"], SIGNAL.tau)
    np.testing.assert_allclose(recorded["t"], SIGNAL.t, rtol=0, atol=1e-9)


def test_inspect_shows_the_state_of_a_franka_by_the_definition_in_its_bag(tmp_path):
    q = np.random.default_rng(0).normal(size=(40, 7))
    for name, ros1 in (("log.bag", True), ("log_mcap", False)):
        states = [
            Message("/franka_states", "franka_msgs/msg/FrankaState", 0.001 * i, {"q": x, "tau_J": 2 * x})
            for i, x in enumerate(q)
        ]
        about = shown(write(tmp_path / name, states, definitions(ros1)))
        assert "/franka_states/stamp" in json.dumps(about["clock"])
        for joint in range(7):
            assert about["head"][f"/franka_states/tau_J[{joint}]"] == (2 * q[:2, joint]).tolist()
