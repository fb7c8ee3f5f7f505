"""The robots: each has a module that exports `ROBOT`, and its name is in `ROBOTS`."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from davinci_forces.errors import BadRobot
from davinci_forces.robots.robot import Joint, Kind, Limits, Robot
from davinci_forces.toml.file import TomlFile

ROBOTS = ("davinci", "dvrk_psm")
FILES = (".toml", ".urdf")  # formats in which laboratories describe their robots

__all__ = ["FILES", "ROBOTS", "Joint", "Kind", "Limits", "Robot", "load"]


def load(name: str, folder: Path) -> Robot:
    """Load a listed robot by its name, or read a robot from a .toml or .urdf file in the folder.

    Raises
    ------
    BadRobot
        If there is no such robot or file, or the file has problems; the message lists each with its line.
    """
    if name.endswith(FILES) and not (folder / name).exists():
        raise BadRobot(
            f"{folder / name}: there is no such robot file; run this in the folder of the file, or give its path"
        )
    robot, file = read_with_problems(name, folder)
    if file:
        file.refuse(BadRobot)
    assert robot is not None
    return robot


def read_with_problems(name: str, folder: Path) -> tuple[Robot | None, TomlFile | None]:
    """Load the robot as `load` does, None if its joints are unknown, and its file with its problems, if it has a file.

    Raises
    ------
    BadRobot
        If there is no such robot, or its file cannot be read at all.
    """
    if name.endswith(".toml"):
        from davinci_forces.robots import from_toml

        return _from(name, from_toml.read_with_problems(folder / name))
    if name.endswith(".urdf"):
        from davinci_forces.robots.urdf import reading

        return _from(name, reading.read_with_problems(folder / name))
    if name not in ROBOTS:
        listed = f"{', '.join(ROBOTS)}, or a file that ends in {' or '.join(FILES)}"
        raise BadRobot(f"there is no robot {name!r}; name one of {listed}")
    return import_module(f"davinci_forces.robots.{name}").ROBOT, None


def _from(name: str, result: tuple[Robot | None, TomlFile]) -> tuple[Robot | None, TomlFile]:
    robot, file = result
    return replace(robot, file=name) if robot else None, file
