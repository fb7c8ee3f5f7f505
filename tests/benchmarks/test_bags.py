"""How fast bags are read, beside rosbags, which makes an object of each message."""

import time
from pathlib import Path

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2

from davinci_forces.logs.ros.bag import open_in_child
from tests.benchmarks.reading import Report
from tests.logs.bag_writer import _store, joint_state, write

JOINTS = [f"panda_joint{i}" for i in range(7)]
LEAST = {"log.bag": 5.0, "log": 3.5, "log_mcap": 5.0}  # SQLite makes an object of each row before anyone reads it


def ours(path: Path) -> float:
    """Open a bag and read all its channels, in this process: the sum of one."""
    log = open_in_child(path)
    blocks = log.blocks([channel.name for channel in log.channels])
    return sum(float(block["/PSM1/measured_js/effort[6]"].sum()) for block in blocks)


def rival(path: Path) -> float:
    """Deserialise all messages, without making columns of them."""
    ros1 = path.suffix == ".bag"
    store = _store(ros1)
    read, total = store.deserialize_ros1 if ros1 else store.deserialize_cdr, 0.0
    with (rosbag1 if ros1 else rosbag2).Reader(path) as reader:
        for connection, _, content in reader.messages():
            total += read(content, connection.msgtype).effort[6]
    return total


@pytest.mark.parametrize("name", LEAST)
def test_joint_states_are_read_several_times_faster_than_rosbags_deserialises_them(
    tmp_path: Path, full: bool, report: Report, name: str
) -> None:
    states = np.random.default_rng(6).normal(size=(200_000 if full else 40_000, 7))
    path = write(tmp_path / name, (joint_state(0.001 * i, JOINTS, x, x, x) for i, x in enumerate(states)))
    taken: dict[str, list[float]] = {"ours": [], "rosbags": []}
    for _ in range(4):
        for who, work in (("ours", ours), ("rosbags", rival)):
            begun = time.process_time()
            assert work(path) == pytest.approx(states[:, 6].sum())
            taken[who].append(time.process_time() - begun)
    fast, slow = min(taken["ours"]), min(taken["rosbags"])
    size = len(states) * 340 / 1e6
    report(f"{name}, {size:.0f} MB: {fast:.3f} s, rosbags {slow:.3f} s, {slow / fast:.1f} x (at least {LEAST[name]})")
    assert slow >= LEAST[name] * fast
