"""What the robot is: one module per robot, exporting `ROBOT`, and its name in the list below."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from davinci_forces.errors import BadRobot
from davinci_forces.robots.robot import Joint, Kind, Limits, Robot
from davinci_forces.toml.file import TomlFile

ROBOTS = ("davinci", "dvrk_psm")
FILES = (".toml", ".urdf")  # in which laboratories describe robots of their own

__all__ = ["FILES", "ROBOTS", "Joint", "Kind", "Limits", "Robot", "described", "load"]


def load(name: str, folder: Path) -> Robot:
    """The robot of that name, or the one that a file beside the study describes, in TOML or as URDF.

    Raises
    ------
    BadRobot
        If there is no such robot or file, or the file is wrong: with every problem of it, each with its line.
    """
    robot, file = described(name, folder)
    if file:
        file.refuse(BadRobot)
    assert robot is not None
    return robot


def described(name: str, folder: Path) -> tuple[Robot | None, TomlFile | None]:
    """The same robot, None where it cannot be told which joints it has, and the problems of its file where it has one.

    Raises
    ------
    BadRobot
        If there is no such robot, or its file cannot be read at all.
    """
    if name.endswith(".toml"):
        from davinci_forces.robots import from_toml

        return _from(name, from_toml.described(folder / name))
    if name.endswith(".urdf"):
        from davinci_forces.robots.urdf import reading

        return _from(name, reading.described(folder / name))
    if name not in ROBOTS:
        said = f"there is no robot {name!r}; there are {', '.join(ROBOTS)}"
        raise BadRobot(f"{said}, or name a file, {' or '.join(FILES)}")
    return import_module(f"davinci_forces.robots.{name}").ROBOT, None


def _from(name: str, described: tuple[Robot | None, TomlFile]) -> tuple[Robot | None, TomlFile]:
    robot, file = described
    return replace(robot, file=name) if robot else None, file
