"""A robot that a laboratory describes in a TOML file of its own, and changes to a listed one.

name = "my_arm"
title = "Our arm"

[[joint]]
name = "shoulder"
kind = "revolute"                       # or "prismatic"
terms = ["inertia", "gravity, sine", "viscous friction", "Coulomb friction"]
gear_ratio = 100.0                      # motor angle over joint position; 1 where logs give the joint side
torque_constant = 0.05                  # [N m/A]
harmonics = 5                           # of the excitation
q_tau = 2.0                             # random walk of the external effort [effort/s^0.5]
limits = { q = [-1.0, 1.0], dq = [-2.0, 2.0], ddq = [-5.0, 5.0] }
"""

import math
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.errors import BadRobot
from pipeline.maths.models.terms import TERMS
from pipeline.robots.robot import Joint, Kind, Limits, Robot

NAME = re.compile(r"[a-z0-9_-]+")
# Names that Windows keeps for devices, whatever comes after a dot: records are files named by log and joint.
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(10))}
ANYWHERE = (-math.inf, math.inf)
UNLIMITED = Limits(ANYWHERE, ANYWHERE, ANYWHERE)
CHANGEABLE = ("title", "terms", "limits", "gear_ratio", "torque_constant", "harmonics", "q_tau")


def read(file: Path) -> Robot:
    """Read a robot.

    Raises
    ------
    BadRobot
        With every problem of the file, each with its place.
    """
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise BadRobot(f"{file}: there is no such robot file") from None
    except OSError as error:
        raise BadRobot(f"{file}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, of numbers and nesting beyond Python's limits
        raise BadRobot(f"{file}: {error}") from None
    problems: list[str] = []
    robot = _robot(table, file.stem, problems)
    if problems:
        raise BadRobot("\n".join(f"{file}: {problem}" for problem in problems))
    return robot


def _robot(table: dict[str, Any], stem: str, problems: list[str]) -> Robot:
    unknown = sorted(set(table) - {"name", "title", "joint"})
    problems += [f"unknown key {key!r}; a robot has name, title and [[joint]] tables" for key in unknown]
    name = table.get("name", stem)
    title = table.get("title", name)
    problems += [f"{key} must be text, not {table[key]!r}" for key in ("name", "title") if not _text(table, key)]
    entries = table.get("joint", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        problems.append(f"joint must be a table: write [[joint]], not joint = {entries!r}")
        entries = []
    elif not entries:
        problems.append("it has no [[joint]]")
    joints = [_joint(i, entry, problems) for i, entry in enumerate(entries, start=1)]
    names = [j.name for j in joints if j]
    problems += [f"two joints are named {twice!r}" for twice in sorted({n for n in names if names.count(n) > 1})]
    return Robot(name, title, tuple(j for j in joints if j))


def _text(table: dict[str, Any], key: str) -> bool:
    return isinstance(table.get(key, ""), str)


def wrong_name(name: Any) -> str:
    """What is wrong with the name of a log or a joint, which names files; "" where nothing is."""
    if not isinstance(name, str) or not NAME.fullmatch(name):
        return f"{name!r} must match [a-z0-9_-]+"
    return f"{name!r} is reserved on Windows; choose another" if name in RESERVED else ""


def is_number(value: Any) -> bool:
    """Whether a value of TOML is a number that a float holds: neither inf nor nan, nor an integer beyond both."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def _joint(number: int, entry: dict[str, Any], problems: list[str]) -> Joint | None:
    place = f"joint {number}"
    name: Any = entry.get("name")
    kind = entry.get("kind")
    if wrong := wrong_name(name):
        problems.append(f"{place}: name {wrong}")
        return None
    if kind not in [k.value for k in Kind]:
        problems.append(f"{place} ({name}): kind is 'revolute' or 'prismatic', not {kind!r}")
        return None
    changes = {key: value for key, value in entry.items() if key not in ("name", "kind")}
    blank = Joint(name=name, title=name.replace("_", " ").capitalize(), kind=Kind(kind), terms=(), limits=UNLIMITED)
    joint = change(blank, changes, f"{place} ({name})", problems)
    if not joint.terms:
        problems.append(f"{place} ({name}): terms lists the terms of its model, of {', '.join(map(repr, TERMS))}")
    return joint


def change(joint: Joint, changes: dict[str, Any], place: str, problems: list[str]) -> Joint:
    """A joint with some of its properties changed; what is wrong is added to the problems."""
    good: dict[str, Any] = {}
    for key, value in changes.items():
        if key not in CHANGEABLE:
            problems.append(f"{place}: unknown key {key!r}; it may say {', '.join(CHANGEABLE)}")
            continue
        try:
            good[key] = _property(key, value)
        except ValueError as error:
            problems.append(f"{place}: {key} {error}")
    return replace(joint, **good)


def _property(key: str, value: Any) -> Any:
    if key == "title":
        return _checked(value, isinstance(value, str), "must be text")
    if key == "terms":
        known = isinstance(value, list) and all(isinstance(name, str) and name in TERMS for name in value)
        _checked(value, known, f"must be a list of {', '.join(map(repr, TERMS))}")
        _checked(value, len(set(value)) == len(value), "must name no term twice")
        return tuple(TERMS[name] for name in value)
    if key == "limits":
        return _limits(value)
    if key == "harmonics":
        return _checked(value, type(value) is int and 1 <= value <= 100, "must be a whole number from 1 to 100")
    number = is_number(value) and value != 0
    if key == "q_tau":
        return float(_checked(value, number and value > 0, "must be a positive number"))
    return float(_checked(value, number, "must be a number other than 0"))


def _limits(value: Any) -> Limits:
    _checked(value, isinstance(value, dict) and set(value) <= {"q", "dq", "ddq"}, "must be a table of q, dq and ddq")
    for name, pair in value.items():
        two = isinstance(pair, list) and len(pair) == 2 and all(is_number(x) or x in ANYWHERE for x in pair)
        _checked(pair, two and pair[0] < pair[1], f"{name} must be [lower, upper]")
    return replace(UNLIMITED, **{name: (float(low), float(high)) for name, (low, high) in value.items()})


def _checked(value: Any, good: bool, says: str) -> Any:
    if not good:
        raise ValueError(f"{says}, not {value!r}")
    return value
