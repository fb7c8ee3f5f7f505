"""The robots: each has a module that exports `ROBOT`, and its name is in `ROBOTS`."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from davinci_forces.errors import BadRobot
from davinci_forces.robots.robot import Joint, Kind, Limits, Robot
from davinci_forces.toml import TomlFile

ROBOTS = ("davinci", "dvrk_psm")
READERS = {".toml": "from_toml", ".urdf": "urdf.reading"}  # modules of formats in which laboratories describe robots
FILES = tuple(READERS)

__all__ = ["FILES", "ROBOTS", "Joint", "Kind", "Limits", "Robot", "load"]


def load(name: str, folder: Path) -> Robot:
    """Load a listed robot by its name, or read a robot from a .toml or .urdf file in the folder.

    Raises BadRobot if there is no such robot or file, or the file has problems; the message lists each with its line.
    """
    if name.endswith(FILES) and not (folder / name).exists():
        remedy = "run this in the folder of the file, or give its path"
        raise BadRobot(f"{folder / name}: there is no such robot file; {remedy}")
    robot, file = read_with_problems(name, folder)
    if file:
        file.refuse(BadRobot)
    assert robot is not None
    return robot


def read_with_problems(name: str, folder: Path) -> tuple[Robot | None, TomlFile | None]:
    """Load the robot as `load` does, None if its joints are unknown, and its file with its problems, if it has a file.

    Raises BadRobot if there is no such robot, or its file cannot be read at all.
    """
    for suffix, reader in READERS.items():
        if name.endswith(suffix):
            robot, file = import_module(f"davinci_forces.robots.{reader}").read_with_problems(folder / name)
            return replace(robot, file=name) if robot else None, file
    if name not in ROBOTS:
        listed = f"{', '.join(ROBOTS)}, or a file that ends in {' or '.join(FILES)}"
        raise BadRobot(f"there is no robot {name!r}; name one of {listed}")
    return import_module(f"davinci_forces.robots.{name}").ROBOT, None
