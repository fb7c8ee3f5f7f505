"""Robots that laboratories describe: whatever the file holds, there is a robot or a message."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from davinci_forces import robots
from davinci_forces.errors import BadRobot
from davinci_forces.robots.from_toml import robot_of
from davinci_forces.toml import TomlFile, TomlTable
from tests import arm
from tests.test_study import ANYTHING, ARM, places_of


def test_a_robot_that_is_written_out_reads_back_as_it_was(tmp_path):
    arm.write_robot(tmp_path)
    assert robots.load("arm.toml", tmp_path) == arm.ARM


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "mine"', "name = 5", "arm.toml:1: name must be text, not 5"),
        ('name = "mine"', 'title = ["a"]', "arm.toml:1: title must be text, not ['a']"),
        (
            'terms = ["inertia", "offset", "viscous friction"]',
            'terms = [["x"]]',
            ":5: joint 1 (shoulder): terms must be a list of 'inertia'",
        ),
        ('"offset"', '"inertia"', ":5: joint 1 (shoulder): terms must name no term twice"),
        ('name = "shoulder"', 'name = "lpt1"', "arm.toml:3: joint 1: name 'lpt1' is reserved on Windows"),
        (
            "gear_ratio = 50.0",
            f"gear_ratio = 1{'0' * 400}",
            ":6: joint 1 (shoulder): gear_ratio must be a number other than 0",
        ),
        ("gear_ratio = 50.0", f"gear_ratio = {'1' * 5000}", "Exceeds the limit"),
        ("gear_ratio = 50.0", 'effort = "N"', ":6: joint 1 (shoulder): effort must be one of A, not 'N'"),
        (
            "gear_ratio = 50.0",
            'effort = "A"\ntorque_constant = 0.05',
            ":7: joint 1 (shoulder): torque_constant is not used where effort is in A; leave one of them out",
        ),
    ],
)
def test_what_is_wrong_with_a_robot_is_said_without_a_traceback(tmp_path, old, new, says):
    assert old in ARM
    (tmp_path / "arm.toml").write_text(ARM.replace(old, new, 1))
    with pytest.raises(BadRobot) as caught:
        robots.load("arm.toml", tmp_path)
    assert says in str(caught.value)


@pytest.mark.parametrize("joint", ["3", "[3]", '"shoulder"', "{}"])
def test_joints_that_are_no_tables_are_refused(tmp_path, joint):
    (tmp_path / "arm.toml").write_text(f"joint = {joint}")
    with pytest.raises(BadRobot, match=r"arm\.toml:1: joint must be a list of tables: write \[\[joint\]\]"):
        robots.load("arm.toml", tmp_path)


def test_a_folder_in_place_of_a_robot_is_refused(tmp_path):
    (tmp_path / "arm.toml").mkdir()
    with pytest.raises(BadRobot, match=r"arm\.toml: "):
        robots.load("arm.toml", tmp_path)


@given(data=st.data())
def test_no_robot_file_however_odd_ends_in_anything_but_problems(data):
    """Any value of a good robot, tables included, replaced by anything that TOML can hold."""
    table = tomllib.loads(ARM)
    parent, key = data.draw(st.sampled_from(places_of(table)))
    parent[key] = data.draw(ANYTHING | st.integers(10**400, 10**401))
    file = TomlFile("arm.toml", {})
    made = robot_of(TomlTable(table, file), "arm")
    assert file.problems() or made.joints
