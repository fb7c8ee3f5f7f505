"""Bags of ROS 1 and 2, and MCAP: the numbers in messages of any type, by topic and field."""

from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

BAG_BEGINNINGS = (b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as a bag, or describes a bag in a folder."""
    return head.startswith(BAG_BEGINNINGS) or head.lstrip().startswith(b"rosbag2_bagfile_information:")


def read(path: Path, options: Options) -> Log:
    """Open the bag, and list its topics and their numbers; raises BadLog without rosbags, or at damage."""
    if path.is_file() and path.suffix == ".yaml":
        raise BadLog(f"{path}: this file describes a ROS 2 bag; name its folder instead, {path.parent}")
    return isolated.read(path, options, reader="davinci_forces.logs.ros.bag", package="rosbags")
