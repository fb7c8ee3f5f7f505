"""Messages of many types, as rosbags writes and deserialises them: every number of each is read, and by its name."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from rosbags import rosbag1, rosbag2
from rosbags.typesys import get_types_from_msg

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from tests.logs.bag_writer import DELAY, START, Message, _store, joint_state, write
from tests.logs.reading import whole

FORMATS = [("log.bag", False), ("log", False), ("log", True), ("log_mcap", False), ("log_mcap", True)]
EVERY_FORMAT = pytest.mark.parametrize(("name", "big"), FORMATS)
JOINTS = ["panda_joint1", "j2", "elbow_joint"]
POINT = """float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
duration time_from_start
"""
CONTROLLER = f"""std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
{"=" * 80}
MSG: trajectory_msgs/JointTrajectoryPoint
"""
FRANKA = f"""std_msgs/Header header
float64[6] cartesian_contact
float64[7] q
float64[7] dq
float64[7] tau_J
float64[7] tau_ext_hat_filtered
float64[6] O_F_ext_hat_K
float64[16] O_T_EE
float64[2] elbow
float64 time
uint8 ROBOT_MODE_IDLE=1
uint8 robot_mode
franka_msgs/Errors current_errors
float32 control_command_success_rate
{"=" * 80}
MSG: franka_msgs/Errors
bool joint_position_limits_violation
bool cartesian_position_limits_violation
"""
ODD = """string text
int8 a
uint16[3] b
string[] words
float32[] c
geometry_msgs/Point[] points
bool[] flags
int64 d
geometry_msgs/Point32 corner
uint8 e
float64[2] f
"""


def definitions(ros1: bool) -> dict[str, str]:
    duration = "duration" if ros1 else "builtin_interfaces/Duration"
    return {
        "control_msgs/msg/JointTrajectoryControllerState": CONTROLLER + POINT.replace("duration", duration),
        "franka_msgs/msg/FrankaState": FRANKA, "lab_msgs/msg/Odd": ODD,
    }  # fmt: skip


def messages(count: int, seed: int = 0):
    """Messages of every type, in turn; texts change in length, and so does a list of messages."""
    rng = np.random.default_rng(seed)

    def x(n):
        return tuple(rng.normal(size=n))

    for i in range(count):
        point = {"positions": x(3), "velocities": x(3), "effort": x(3), "time_from_start": (i, 5 * 10**8)}
        words = ["w" * int(rng.integers(9)) for _ in range(int(rng.integers(4)))]
        each = {
            "/f64": ("std_msgs/msg/Float64", {"data": x(1)[0]}),
            "/multi": ("std_msgs/msg/Float64MultiArray", {"layout": {"dim": [{"label": "a" * i}]}, "data": x(5)}),
            "/js": ("sensor_msgs/msg/JointState", {"name": JOINTS, "position": x(3), "effort": x(3)}),
            "/imu": ("sensor_msgs/msg/Imu",
                     {"orientation": x(4), "angular_velocity": x(3), "linear_acceleration": x(3)}),
            "/v": ("geometry_msgs/msg/Vector3Stamped", {"vector": x(3)}),
            "/accel": ("geometry_msgs/msg/AccelStamped", {"accel": {"linear": x(3), "angular": x(3)}}),
            "/plain_accel": ("geometry_msgs/msg/Accel", {"linear": x(3), "angular": x(3)}),
            "/wrench": ("geometry_msgs/msg/Wrench", {"force": x(3), "torque": x(3)}),
            "/odom": ("nav_msgs/msg/Odometry", {"child_frame_id": "f" * (i % 5), "twist": {"twist": {"linear": x(3)}}}),
            "/state": ("control_msgs/msg/JointTrajectoryControllerState",
                       {"joint_names": JOINTS, "desired": point, "actual": point}),
            "/franka": ("franka_msgs/msg/FrankaState",
                        {"q": x(7), "dq": x(7), "tau_J": x(7), "O_F_ext_hat_K": x(6), "O_T_EE": x(16), "time": x(1)[0],
                         "robot_mode": i % 7, "control_command_success_rate": 0.5}),
            "/odd": ("lab_msgs/msg/Odd",
                     {"text": "t" * int(rng.integers(12)), "a": -i, "b": (i, 2, 65535), "words": words, "c": (1.5, i),
                      "points": [x(3)] * int(rng.integers(3)), "d": -(2**40) - i, "corner": (i, 0.25, 0), "f": x(2)}),
        }  # fmt: skip
        for k, (topic, (kind, fields)) in enumerate(each.items()):
            yield Message(topic, kind, 0.01 * i + 1e-4 * k, fields)


def deserialised(path: Path, ros1: bool) -> dict[str, list]:
    """The witness: what rosbags makes of each message, by topic, with the time of receipt."""
    store = _store(ros1)
    for kind, text in definitions(ros1).items():
        store.register(get_types_from_msg(text, kind))
    read = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    by_topic: dict[str, list] = {}
    with (rosbag1 if ros1 else rosbag2).Reader(path) as reader:
        for connection, received, content in reader.messages():
            by_topic.setdefault(connection.topic, []).append((received, read(content, connection.msgtype)))
    return by_topic


FIRST = 200_000  # [ns] from START to the earliest time of a clock: that of /js in its header
HOLDERS = {"/v": "vector", "/accel": "accel"}


def value(message, field: str) -> float:
    for name, index in re.findall(r"([A-Za-z_0-9]+)|\[(\d+)\]", field):
        message = getattr(message, name) if name else message[int(index)]
    return message.sec + 1e-9 * message.nanosec if hasattr(message, "nanosec") else float(message)


@EVERY_FORMAT
def test_every_number_is_what_rosbags_deserialises(name, big, tmp_path):
    ros1 = name == "log.bag"
    path = write(tmp_path / name, messages(25), definitions(ros1), big)
    log, samples = whole(path)
    expected = deserialised(path, ros1)
    count = 0
    for channel, read in samples.items():
        topic, _, field = channel[1:].partition("/")
        truth = expected[f"/{topic}"]
        assert len(read) == len(truth) == 25
        if field in ("stamp", "received"):
            ns = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec if field == "stamp" else r for r, m in truth]
            assert_array_equal(read, (np.array(ns) - START - FIRST) / 1e9)
            continue
        prefix = f"{HOLDERS[f'/{topic}']}." if f"/{topic}" in HOLDERS else ""
        assert_array_equal(read, [value(message, prefix + field) for _, message in truth])
        count += 1
    assert count == 1 + 5 + 6 + 37 + 3 + 6 + 6 + 6 + 85 + 2 * 10 + 1 + 61 + 13
    assert not [channel for channel in log.channels if channel.kind not in ("number", "time")]


def test_channels_have_the_names_of_joints_and_the_units_of_their_types(tmp_path):
    log = open_log(write(tmp_path / "log.bag", messages(3), definitions(True)))
    assert log.find("/state/actual.positions[elbow_joint]").name == "/state/actual.positions[2]"
    assert log.find("/js/effort[panda_joint1]").name == "/js/effort[0]"
    units = {
        "/wrench/torque.y": "N m", "/accel/linear.z": "m/s^2", "/plain_accel/angular.x": "rad/s^2", "/v/x": "",
        "/imu/angular_velocity.y": "rad/s", "/odom/twist.twist.linear.x": "m/s", "/odom/pose.pose.position.x": "m",
        "/imu/orientation.w": "", "/state/desired.time_from_start": "s", "/franka/q[6]": "",
    }  # fmt: skip
    assert {name: log.find(name).unit for name in units} == units
    assert log.find("/franka/q[3]").time == "/franka/stamp"
    assert log.find("/f64/data").time == "/f64/received"
    assert log.facts["/f64"] == "std_msgs/Float64, 3 messages, on the recorder's clock"
    assert not log.warnings


@EVERY_FORMAT
def test_names_and_lists_that_change_move_the_numbers_but_not_the_channels(name, big, tmp_path):
    """The order and the lengths of names change, and with them where CDR pads."""
    joints = ["panda_joint1", "j2", "j3"]  # two orders of one size and length of names
    rng = np.random.default_rng(1)
    truth, sent = rng.normal(size=(3, 200, 3)), []
    for i in range(200):
        order = rng.permutation(3)
        names = [joints[k] for k in order]
        velocity = truth[1, i][order] if i != 150 else ()
        sent.append(joint_state(0.01 * i, names, truth[0, i][order], velocity, truth[2, i][order]))
    log = open_log(write(tmp_path / name, sent, big=big))
    for number, symbol in ((0, "position"), (2, "effort")):
        for k, joint in enumerate(joints):
            channel = next(c for c in log.channels if c.alias == f"/PSM1/measured_js/{symbol}[{joint}]").name
            assert_array_equal(np.concatenate([b[channel] for b in log.blocks([channel])]), truth[number, :, k])
    with pytest.raises(BadLog, match=r"velocity\[0\]' holds lists of unsteady length"):
        list(log.blocks(["/PSM1/measured_js/velocity[0]"]))


def test_texts_pictures_long_lists_and_services_are_left_out_with_a_word(tmp_path):
    pictures = [
        Message("/camera", "sensor_msgs/msg/CompressedImage", 0.1 * i, {"data": [7] * (300 + i)}) for i in range(3)
    ]
    scans = [Message("/scan", "sensor_msgs/msg/LaserScan", 0.1 * i, {"ranges": [1.0] * 720}) for i in range(3)]
    transforms = [Message("/tf", "tf2_msgs/msg/TFMessage", 0.1 * i, {"transforms": [{}] * (i + 1)}) for i in range(3)]
    others = [
        Message("/word", "std_msgs/msg/String", 0.0, {"data": "x"}), Message("/out", "rcl_interfaces/msg/Log", 0.0),
        Message("/sum", "std_msgs/msg/Float64", 0.0, {"data": 1.0}),
    ]  # fmt: skip
    log, samples = whole(write(tmp_path / "log", [*pictures, *scans, *transforms, *others]))
    assert {name.split("/")[1] for name in samples} == {"scan", "sum"}
    left_out = log.facts["left out"]
    for topic in ("/camera", "/tf", "/word", "/out"):
        assert topic in left_out
    assert "ranges (720 numbers)" in log.facts["/scan"]


def test_messages_that_do_not_fit_their_definition_are_refused(tmp_path):
    """As where a bag without definitions holds another version of a type."""
    import sqlite3

    [database] = write(tmp_path / "log", [joint_state(0.0, JOINTS, (1, 2, 3)), joint_state(0.1, JOINTS)]).glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("UPDATE topics SET type = 'geometry_msgs/msg/WrenchStamped'")
        connection.execute("DELETE FROM message_definitions")
    connection.close()
    with pytest.raises(BadLog, match="does not fit its definition"):
        open_log(database)


def test_the_order_of_time_is_that_of_receipt(tmp_path):
    shuffled = np.random.default_rng(2).permutation(300)
    for name in ("log.bag", "log", "log_mcap"):
        path = write(tmp_path / name, (joint_state(0.01 * i, ["a"], [float(i)]) for i in shuffled))
        _, samples = whole(path)
        assert_array_equal(samples["/PSM1/measured_js/position[0]"], np.arange(300.0))
        received = 0.01 * np.arange(300) + DELAY / 1e9
        np.testing.assert_allclose(samples["/PSM1/measured_js/received"], received, rtol=0, atol=1e-9)
