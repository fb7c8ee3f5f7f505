"""What the robot is: one module per robot, exporting `ROBOT`, and its name in the list below."""

from importlib import import_module
from pathlib import Path

from pipeline.errors import BadRobot
from pipeline.robots.robot import Joint, Kind, Limits, Robot

ROBOTS = ("davinci", "dvrk_psm")

__all__ = ["ROBOTS", "Joint", "Kind", "Limits", "Robot", "load"]


def load(name: str, folder: Path) -> Robot:
    """The robot of that name, or the one that a TOML file beside the study describes.

    Raises
    ------
    BadRobot
        If there is no such robot or file, or the file is wrong.
    """
    if name.endswith(".toml"):
        from pipeline.robots.from_toml import read

        return read(folder / name)
    if name not in ROBOTS:
        raise BadRobot(f"there is no robot {name!r}; there are {', '.join(ROBOTS)}, or name a .toml file")
    robot: Robot = import_module(f"pipeline.robots.{name}").ROBOT
    return robot
