"""`davinci-forces robot`: the numbers of the library, as JSON and as text, and its refusals."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from davinci_forces.cli import errors_as_messages
from davinci_forces.commands import robot
from davinci_forces.errors import BadRobot
from davinci_forces.maths.mechanics import kinematics, rigid_body, tip_force
from davinci_forces.robots.davinci import BODIES, CHAIN
from davinci_forces.robots.davinci import ROBOT as DAVINCI

KEYS = [
    "frames", "tip", "remote_centre", "jacobian_v", "jacobian_w", "mass", "coriolis", "gravity", "condition",
    "warnings", "joints",
]  # fmt: skip
app = typer.Typer()
app.command()(errors_as_messages()(robot.run))


def asked(*words):
    return CliRunner().invoke(app, list(words))


def document(*words):
    result = asked(*words, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.mark.parametrize("n", [3, 6, 7])
def test_the_json_holds_what_the_library_computes(n):
    q, dq = np.random.default_rng(n).uniform(-0.06, 0.1, (2, n))
    found = document("davinci", "--at", ",".join(map(str, q)), "--dq", ",".join(map(str, dq)))
    assert list(found) == KEYS
    assert list(found["frames"]) == ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9L", "9R"]
    for name, T in zip(CHAIN.names, kinematics.frames(CHAIN, q), strict=True):
        np.testing.assert_array_equal(found["frames"][name]["origin"], T[:3, 3])
        np.testing.assert_array_equal(found["frames"][name]["rotation"], T[:3, :3])
    assert found["tip"] == found["frames"]["9L"]["origin"]
    assert found["remote_centre"] == pytest.approx([0.0, 0.48, 0.161])
    J_v, J_w = kinematics.jacobian(CHAIN, q)
    np.testing.assert_array_equal(found["jacobian_v"], J_v)
    np.testing.assert_array_equal(found["jacobian_w"], J_w)
    np.testing.assert_array_equal(found["mass"], rigid_body.mass_matrix(CHAIN, BODIES, q))
    np.testing.assert_array_equal(found["coriolis"], rigid_body.coriolis(CHAIN, BODIES, q, dq))
    np.testing.assert_array_equal(found["gravity"], rigid_body.gravity(CHAIN, BODIES, q))
    assert found["condition"] == pytest.approx(np.linalg.cond(J_v[:, :3]))
    assert found["warnings"] == []


def test_without_velocities_nothing_is_centrifugal():
    assert document("davinci", "--at", "0.1,0.2,0.03")["coriolis"] == [0, 0, 0]


def test_velocities_that_are_missing_are_zero():
    pose = ("davinci", "--at", "0.1,0.2,0.03")
    assert document(*pose, "--dq", "0.5")["coriolis"] == document(*pose, "--dq", "0.5,0,0")["coriolis"]


def test_without_a_pose_all_six_joints_are_at_zero():
    assert document("davinci") == document("davinci", "--at", "0,0,0,0,0,0")


def test_a_joint_beyond_its_limits_is_stated_and_computed_all_the_same():
    found = document("davinci", "--at", "0.9,0,0.2")
    assert [words.split()[0] for words in found["warnings"]] == ["hand_roll", "instrument_slide"]
    assert "hand_roll at 0.9 rad is outside its limits, -0.6 to 0.6 rad" in asked("davinci", "--at", "0.9,0,0").stdout


@pytest.mark.parametrize("pose", ["0,0,-0.1101", "0,0,-0.1101,0,0,0", "0.2,0.3,-0.1101"])
def test_a_singular_pose_has_no_condition_number_and_says_why(pose):
    found = document("davinci", "--at", pose)
    assert found["condition"] is None
    assert "singular" in found["warnings"][-1]
    assert f"above {tip_force.SINGULAR:g}" in found["warnings"][-1]
    assert "-0.1101" in found["warnings"][-1]
    assert "condition of J_v   singular" in asked("davinci", "--at", pose).stdout


def test_an_arm_of_two_joints_has_no_condition_of_a_force_at_the_tip_and_no_warning_of_one(tmp_path):
    """Two joints never determine such a force, whatever the pose."""
    joint = '[[joint]]\nname = "{}"\nkind = "revolute"\nterms = ["inertia"]\n'
    links = (
        '[[link]]\nname = "upper"\nalpha = 1.5708\nmoved_by = "a"\n[[link]]\nname = "fore"\na = 0.3\nmoved_by = "b"\n'
    )
    file = tmp_path / "planar.toml"
    file.write_text('convention = "modified"\n' + joint.format("a") + joint.format("b") + links)
    assert (document(str(file))["condition"], document(str(file))["warnings"]) == (None, [])
    assert "singular" not in asked(str(file)).stdout


def test_the_text_shows_every_matrix_and_no_rounding_errors():
    text = asked("davinci").stdout
    for title in ("frame   origin [m]", "tip [m]", "J_v of the tip", "J_omega", "\nM\n", "C dq", "G   ", "condition"):
        assert title in text
    assert "e-1" not in text
    slide = next(joint for joint in DAVINCI.joints if joint.name == "instrument_slide")
    assert f"gear ratio {slide.gear_ratio:g}, torque constant {slide.torque_constant:g} N m/A; effort in N" in text


def test_a_negative_first_value_is_a_value():
    assert document("davinci", "--at", "-0.1,0,0")["tip"][0] != 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--at", "0.1,0.2"), "--at has 2 values; the pose of davinci has 3, 6 or 7"),
        (("--at", "0.1,x,0"), "--at 0.1,x,0: value 2 is 'x', not a number"),
        (("--at", "0.1,nan,0"), "value 2 is nan, and must be finite"),
        (("--at", "0,0,0", "--dq", "1,2,3,4"), "--dq has 4 values and the pose 3; give at most 3"),
    ],
)
def test_bad_input_is_refused_with_its_place(words, says):
    result = asked("davinci", *words)
    assert result.exit_code == 1
    assert says in result.output


MINE = 'name = "mine"\n[[joint]]\nname = "a"\nkind = "revolute"\nterms = ["inertia", "gravity, sine"]\n'
LINK = '[[link]]\nname = "l"\nmoved_by = "a"\nalpha = 1.5\nmass = 2.0\ncentre = [0.1, 0.0, 0.0]\n'


def test_a_robot_without_geometry_shows_its_joints_and_has_no_pose(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(MINE)
    assert "a   revolute, unlimited; effort in N m: inertia + gravity, sine" in asked(str(file)).stdout
    found = document(str(file))["joints"]["a"]
    assert found["limits"] == {"q": [None, None], "dq": [None, None], "ddq": [None, None], "effort": None}
    for words in (("--at", "0.1"), ("--dq", "0.1")):
        result = asked(str(file), *words)
        assert result.exit_code == 1
        assert "robot mine has no chain: its geometry is not known; leave --at and --dq out" in result.output
    result = asked(str(file), "--urdf")
    assert result.exit_code == 1
    assert "robot mine has no chain: its geometry is not known, and a URDF needs it" in result.output


def test_a_robot_that_does_not_exist_is_refused():
    with pytest.raises(BadRobot, match="no robot 'nonsuch'; name one of davinci, dvrk_psm, or a file"):
        robot.run("nonsuch", None, None, False)


def test_a_robot_of_ones_own_with_a_chain_is_shown_with_as_many_joints_as_it_has(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(MINE + LINK)
    found = document(str(file))
    assert list(found) == KEYS
    np.testing.assert_allclose(found["mass"], [[2.0 * 0.1**2]])
    assert "pose of mine has 1" in asked(str(file), "--at", "0,0").output


def test_the_urdf_that_is_printed_is_shown_as_the_same_arm(tmp_path):
    file = tmp_path / "copy.urdf"
    file.write_text(asked("davinci", "--urdf").stdout)
    pose = ("--at", "0.1,0.2,0.03,0.1,-0.2,0.3,0.4", "--dq", "0.3,0.2,0.1,0.5,0.5,0.5,0.5")
    found, expected = document(str(file), *pose), document("davinci", *pose)
    for key in ("tip", "mass", "coriolis", "gravity"):
        np.testing.assert_allclose(found[key], expected[key], rtol=0, atol=1e-12)
    assert found["joints"]["hand_roll"]["limits"]["q"] == expected["joints"]["hand_roll"]["limits"]["q"]


def test_the_direction_of_a_joint_is_that_in_the_middle_of_its_range_or_at_the_pose():
    """A slide that is drawn in has the tip of the dVRK's arm on the other side of the remote centre."""
    for words, direction in ((), "(1, 0, 0) in mid-range"), (("--at", "0,0,0.001"), "(-1, 0, 0)"):
        [roll] = [line for line in asked("dvrk_psm", *words).output.splitlines() if line.startswith("       hand_roll")]
        assert roll.endswith(f"; positive: the tip moves along {direction}")
