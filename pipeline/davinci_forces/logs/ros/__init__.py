"""Bags of ROS 1 and 2, and MCAP: joint states, wrenches, twists and poses, by topic."""

from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

BEGINNINGS = (b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0")
METADATA = b"rosbag2_bagfile_information:"  # what the description of a bag in a folder begins with


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as a bag, or is the description of one in a folder."""
    return head.startswith(BEGINNINGS) or head.lstrip().startswith(METADATA)


def read(path: Path, options: Options) -> Log:
    """Open the bag: list its topics, and what the first message of each holds.

    Raises
    ------
    BadLog
        If rosbags is not installed, or the bag cannot be read.
    """
    if path.is_file() and path.suffix == ".yaml":
        raise BadLog(f"{path}: it describes a bag of ROS 2; name the folder that it is in, {path.parent}")
    isolated.require(path, "rosbags", "ros")
    return isolated.start(path, options, "davinci_forces.logs.ros.bag")
