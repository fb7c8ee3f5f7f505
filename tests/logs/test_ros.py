"""Bags of ROS 1 and 2: joints by number and by name, clocks of headers and of the recorder, and bags that are odd."""

import itertools
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from tests.logs.bag_writer import joint_state, vectors, write

NAMES = ["outer_yaw", "outer_pitch", "outer_insertion"]
KINDS = ("log.bag", "log", "log_mcap")
T = 0.01 * np.arange(60)


def values(i: int) -> np.ndarray:
    return np.array([i, 10 + i, 20 + i], float)


def states(order=(0, 1, 2), since=0, **about):
    """States of three joints, from one message on in another order."""
    for i, t in enumerate(T):
        at = list(order) if i >= since else [0, 1, 2]
        q = values(i)[at]
        yield joint_state(t, [NAMES[k] for k in at], q, 2 * q, -q, **about)


def column(log, *names: str) -> list[np.ndarray]:
    found = [log.find(name).name for name in names]
    blocks = list(log.blocks(found))
    return [np.concatenate([block[name] for block in blocks]) for name in found]


@pytest.mark.parametrize("kind", KINDS)
def test_joints_have_a_number_and_a_name(kind, tmp_path):
    log = open_log(write(tmp_path / kind, states()))
    for i, name in enumerate(NAMES):
        numbered, named, short = (
            f"/PSM1/measured_js/effort[{i}]", f"/PSM1/measured_js/effort[{name}]", f"effort[{name}]"
        )  # fmt: skip
        assert log.find(numbered) == log.find(named) == log.find(short)
        assert_array_equal(column(log, named)[0], [-values(k)[i] for k in range(len(T))])
    assert "outer_yaw, outer_pitch, outer_insertion" in log.facts["/PSM1/measured_js"]


@pytest.mark.parametrize("kind", KINDS)
def test_the_clock_is_that_of_the_headers_and_the_recorder_s_is_there_too(kind, tmp_path):
    log = open_log(write(tmp_path / kind, states()))
    stamp, received = column(log, "/PSM1/measured_js/stamp", "/PSM1/measured_js/received")
    assert log.time == "/PSM1/measured_js/stamp"
    assert (log.started, log.zone) == ("2023-11-14T22:13:20", "UTC")
    assert_allclose(stamp, T, rtol=0, atol=1e-9)
    assert_allclose(received, T + 0.002, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_topics_have_clocks_of_their_own_and_vectors_have_units(kind, tmp_path):
    pairs = (("force", (1.0, 2.0, 3.0)), ("torque", (4.0, 5.0, 6.0)))
    twist = (("linear", (0.1, 0.2, 0.3)), ("angular", (0.4, 0.5, 0.6)))
    pose = (("position", (0.7, 0.8, 0.9)), ("orientation", (0.0, 0.0, 0.6, 0.8)))
    place = (("translation", (0.7, 0.8, 0.9)), ("rotation", (0.0, 0.0, 0.6, 0.8)))
    others = [
        vectors(0.003, "WrenchStamped", "wrench", *pairs, topic="/PSM1/body/measured_cf"),
        vectors(0.004, "TwistStamped", "twist", *twist, topic="/PSM1/measured_cv"),
        vectors(0.005, "PoseStamped", "pose", *pose, topic="/PSM1/measured_cp"),
        vectors(0.006, "TransformStamped", "transform", *place, topic="/PSM1/old/measured_cp"),
    ]
    log = open_log(write(tmp_path / kind, [*states(), *others]))
    assert log.time == ""
    expected = {
        "/PSM1/body/measured_cf": ({"force.z": (3.0, "N"), "torque.x": (4.0, "N m")}, 0.003),
        "/PSM1/measured_cv": ({"linear.y": (0.2, "m/s"), "angular.z": (0.6, "rad/s")}, 0.004),
        "/PSM1/measured_cp": ({"position.x": (0.7, "m"), "orientation.w": (0.8, "")}, 0.005),
        "/PSM1/old/measured_cp": ({"translation.x": (0.7, "m"), "rotation.z": (0.6, "")}, 0.006),
    }
    for topic, (quantities, t) in expected.items():
        for name, (value, unit) in quantities.items():
            channel = log.find(f"{topic}/{name}")
            assert (channel.unit, channel.time) == (unit, f"{topic}/stamp")
            stamp, read = column(log, f"{topic}/stamp", channel.name)
            assert (stamp.tolist(), read.tolist()) == ([pytest.approx(t, abs=1e-9)], [value])
    with pytest.raises(BadLog, match="have 2 clocks"):
        column(log, "effort[0]", "/PSM1/measured_cv/linear.x")


@pytest.mark.parametrize("kind", KINDS)
def test_joints_that_change_their_order_are_told_apart_by_name(kind, tmp_path):
    log = open_log(write(tmp_path / kind, states(order=(2, 0, 1), since=30)))
    whole = open_log(write(tmp_path / f"still-{kind}", states()))
    for state in ("position", "velocity", "effort"):
        for i in range(3):
            assert_array_equal(*column(log, f"{state}[{i}]"), *column(whole, f"{state}[{i}]"))


def test_a_joint_that_is_missing_halfway_has_no_channel_and_the_others_are_told_apart_by_name(tmp_path):
    log = open_log(write(tmp_path / "log", states(order=(2, 0), since=30)))
    assert_array_equal(column(log, "position[outer_insertion]")[0], [values(i)[2] for i in range(60)])
    with pytest.raises(BadLog, match=r"effort\[1\]' holds lists of unsteady length, not numbers"):
        column(log, "effort[outer_pitch]")


def test_an_array_that_ends_halfway_is_refused_and_the_others_are_read(tmp_path):
    messages = list(states())
    messages[40] = joint_state(T[40], NAMES, values(40), (), -values(40))
    log = open_log(write(tmp_path / "log", messages))
    assert_array_equal(column(log, "effort[0]")[0], [-values(i)[0] for i in range(60)])
    with pytest.raises(BadLog, match=r"velocity\[2\]' holds lists of unsteady length"):
        column(log, "velocity[2]")


def test_an_array_that_ends_halfway_without_a_change_of_size_is_named(tmp_path):
    messages = [joint_state(t, NAMES, values(i), 2 * values(i)) for i, t in enumerate(T)]
    messages[40] = joint_state(T[40], NAMES, values(40), (), values(40))
    log = open_log(write(tmp_path / "log.bag", messages))
    assert len(column(log, "position[2]")[0]) == 60
    with pytest.raises(BadLog, match=r"message 40 of /PSM1/measured_js has no velocity\[1\] \(outer_pitch\)"):
        column(log, "velocity[1]")


def test_joints_without_names_keep_their_number_and_a_change_of_it_is_refused(tmp_path):
    messages = [joint_state(t, [], values(i)) for i, t in enumerate(T)]
    [last] = column(open_log(write(tmp_path / "log", messages)), "position[2]")
    assert_array_equal(last, 20.0 + np.arange(60))
    messages[50] = joint_state(T[50], [], values(50)[:2])
    with pytest.raises(BadLog, match=r"position\[0\]' holds lists of unsteady length"):
        column(open_log(write(tmp_path / "short", messages)), "position[0]")


def test_names_that_do_not_match_their_values_are_refused(tmp_path):
    with pytest.raises(BadLog, match=r"/PSM1/measured_js \(.*: a message names 3 joints but has 2 of position\)"):
        open_log(write(tmp_path / "log", [joint_state(0.0, NAMES, (1.0, 2.0))]))


def test_messages_of_other_joints_on_the_same_topic_are_left_out_and_remarked_on(tmp_path):
    arm = list(states(topic="/joint_states"))
    jaw = [joint_state(t + 0.005, ["jaw"], [0.5], topic="/joint_states") for t in T]
    log = open_log(write(tmp_path / "log", sorted([*arm, *jaw], key=lambda message: message.t)))
    assert_array_equal(column(log, "position[outer_yaw]")[0], [values(i)[0] for i in range(60)])
    assert log.dropped == 60
    [remark] = log.warnings
    assert "message 1 of /joint_states is of other joints (jaw)" in remark


def test_headers_without_a_time_leave_the_recorder_s_which_is_remarked_on(tmp_path):
    log = open_log(write(tmp_path / "log", states(stamped=False)))
    assert log.time == "/PSM1/measured_js/received"
    assert_allclose(column(log, log.time)[0], T, rtol=0, atol=1e-9)
    assert "carry no time" in log.warnings[0]


def test_a_bag_of_nothing_that_is_read_says_what_it_has(tmp_path):
    empty = write(tmp_path / "log", [])
    with pytest.raises(BadLog, match="no message with numbers; its topics are none"):
        open_log(empty)


def test_a_folder_that_is_no_bag_and_a_description_without_its_folder_are_refused(tmp_path):
    with pytest.raises(BadLog, match=r"this folder has no metadata\.yaml or \*\.db3 or \*\.mcap"):
        open_log(tmp_path)
    bag = write(tmp_path / "log", states())
    with pytest.raises(BadLog, match=r"this file describes a ROS 2 bag; name its folder"):
        open_log(bag / "metadata.yaml")


def test_without_rosbags_the_message_says_how_to_install_it(tmp_path, monkeypatch):
    bag = write(tmp_path / "log.bag", states())
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(BadLog, match=r"-m pip install rosbags$"):
        open_log(bag)


def test_types_that_the_bag_does_not_define_are_those_of_ros(tmp_path):
    """As bags of SQLite did not until 2023."""
    import sqlite3

    [database] = write(tmp_path / "log", states()).glob("*.db3")
    before = column(open_log(database), "effort[1]")[0]
    with sqlite3.connect(database) as connection:
        connection.execute("DELETE FROM message_definitions")
    connection.close()
    assert_array_equal(column(open_log(database), "effort[1]")[0], before)


@pytest.mark.parametrize("kind", KINDS)
def test_signs_in_the_names_of_folders_and_files_mean_nothing(kind, tmp_path):
    home = tmp_path / "day #2 50%"
    home.mkdir()
    bag = write(tmp_path / kind, states()).rename(home / "run #3%41")
    assert len(column(open_log(bag), "effort[1]")[0]) == len(T)
    if bag.is_dir():
        [storage] = [file for file in bag.iterdir() if file.suffix != ".yaml"]
        assert len(column(open_log(storage), "effort[1]")[0]) == len(T)


def test_fields_of_a_record_of_ros_1_are_read_in_any_order():
    from davinci_forces.logs.ros.rosbag1 import _fields

    message = (b"op=\x02", b"conn=\1\0\0\0", b"time=\1\2\3\4\5\6\7\x08")
    later = (*message[:2], b"time=\2\2\3\4\5\6\7\x08")
    for fields in (*itertools.permutations(message), *itertools.permutations(later)):
        header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
        assert _fields(header) == dict(field.split(b"=") for field in fields)


@pytest.mark.medium
def test_blocks_of_a_long_bag_are_bounded_and_whole(tmp_path):
    from davinci_forces.logs.ros.bag import open_in_child
    from davinci_forces.logs.ros.scan import BATCH_MESSAGES

    count = 2 * BATCH_MESSAGES + 5
    messages = (joint_state(0.001 * i, ["roll"], [i]) for i in range(count))
    log = open_in_child(write(Path(tmp_path) / "log", messages))
    blocks = [block["/PSM1/measured_js/position[0]"] for block in log.blocks(["/PSM1/measured_js/position[0]"])]
    assert max(map(len, blocks)) == BATCH_MESSAGES
    assert_array_equal(np.concatenate(blocks), np.arange(count))
