"""A robot that a laboratory describes in a TOML file of its own, and changes to a listed one.

name = "my_arm"
title = "Our arm"

[[joint]]
name = "shoulder"
kind = "revolute"                       # or "prismatic"
terms = ["inertia", "gravity, sine", "viscous friction", "Coulomb friction"]
gear_ratio = 100.0                      # motor angle over joint position; 1 where logs give the joint side
torque_constant = 0.05                  # [N m/A]; or, where it is not known, effort = "A"
harmonics = 5                           # of the excitation
limits = { q = [-1.0, 1.0], dq = [-2.0, 2.0], ddq = [-5.0, 5.0] }    # and effort = 10.0, which is not exceeded

Its geometry, where it is known, is said by [[link]], as `chain_table` reads them.
"""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from davinci_forces import toml
from davinci_forces.errors import BadRobot
from davinci_forces.maths.models.terms import TERMS, Term
from davinci_forces.robots import chain_table
from davinci_forces.robots.robot import ANYWHERE, Joint, Kind, Limits, Robot
from davinci_forces.toml import TomlTable, is_number, shown
from davinci_forces.toml.file import TomlFile

NAME = re.compile(r"[a-z0-9_-]+")
# Names that Windows keeps for devices, whatever comes after a dot: records are files named by log and joint.
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(10))}
UNLIMITED = Limits(ANYWHERE, ANYWHERE, ANYWHERE)
KINDS = tuple(kind.value for kind in Kind)


def described(file: Path) -> tuple[Robot | None, TomlFile]:
    """A robot, None where it cannot be told which joints it has, and the problems of its file; raises BadRobot where
    that is not TOML.
    """
    table = toml.read(file, BadRobot, "there is no such robot file")
    return robot_of(table, file.stem), table.file


def robot_of(table: TomlTable, stem: str) -> Robot | None:
    """A robot, its problems noted; None where it cannot be told which joints it has."""
    name = table.text("name", stem)
    title = table.text("title", name)
    entries = table.tables("joint", "it has no [[joint]]")
    joints = [_joint(entry) for entry in entries]
    table.unique("joint", "name", ((i, joint.name) for i, joint in enumerate(joints) if joint), "two joints are named")
    known = tuple(joint for joint in joints if joint)
    carried = chain_table.read(table, known)
    table.close()
    return Robot(name, title, known, *carried) if known and len(known) == len(joints) else None


def wrong_name(name: str) -> str:
    """What is wrong with the name of a log or a joint, which names files; "" where nothing is."""
    if not NAME.fullmatch(name):
        return f"{shown(name)} must match [a-z0-9_-]+"
    return f"{name!r} is reserved on Windows; choose another" if name in RESERVED else ""


def _joint(table: TomlTable) -> Joint | None:
    """A joint, its problems noted; None where its name or kind is not known."""
    name = table.text("name")
    wrong = wrong_name(name)
    if wrong and isinstance(table.values.get("name"), str):
        table.problem(f"name {wrong}", "name")
    table.place += "" if wrong else f" ({name})"
    kind = table.text("kind", choices=KINDS)
    blank = Joint(name, name.replace("_", " ").capitalize(), Kind(kind or KINDS[0]), (), UNLIMITED)
    joint = change(blank, table)
    if "terms" not in table:
        table.problem(f"terms lists the terms of its model, of {', '.join(map(repr, TERMS))}")
    return None if wrong or not kind else joint


def change(joint: Joint, table: TomlTable) -> Joint:
    """A joint with those of its properties changed that a table names; what is wrong is noted."""
    changed = replace(
        joint,
        title=table.text("title", joint.title),
        terms=_terms(table) if "terms" in table else joint.terms,
        limits=_limits(table) if "limits" in table else joint.limits,
        gear_ratio=_not_zero(table, "gear_ratio", joint.gear_ratio),
        torque_constant=_not_zero(table, "torque_constant", joint.torque_constant),
        effort=table.text("effort", joint.effort, choices=("A",)) if "effort" in table else joint.effort,
        harmonics=table.take(
            "harmonics", joint.harmonics, (int,), "a whole number from 1 to 100", lambda x: 1 <= x <= 100
        ),
        q_tau=float(table.take("q_tau", joint.q_tau, (int, float), "a number from 0 on", lambda x: 0 <= x < math.inf)),
    )
    if changed.effort != joint.effort and "limits" not in table:  # which is then in another unit
        changed = replace(changed, limits=replace(changed.limits, effort=math.inf))
    if "effort" in table and "torque_constant" in table:
        table.problem("torque_constant is not used where effort is in A; leave one of them out", "torque_constant")
    table.close()
    return changed


def _terms(table: TomlTable) -> tuple[Term, ...]:
    names = table.texts("terms", None, TERMS)
    if len(set(names)) < len(names):
        table.problem(f"terms must name no term twice, not {shown(list(names))}", "terms")
    return tuple(TERMS[name] for name in names)


def _not_zero(table: TomlTable, key: str, default: float) -> float:
    return float(table.take(key, default, (int, float), "a number other than 0", lambda x: x != 0 and is_number(x)))


def _limits(table: TomlTable) -> Limits:
    limits = table.table("limits")
    q, dq, ddq = (_bounds(limits, name) if name in limits else ANYWHERE for name in ("q", "dq", "ddq"))
    changed = Limits(q, dq, ddq)
    if "effort" in limits:
        changed = replace(changed, effort=limits.number("effort", above=0.0, words="the most effort of its drive"))
    limits.close()
    return changed


def _bounds(limits: TomlTable, name: str) -> tuple[float, float]:
    low, high = limits.take(name, list(ANYWHERE), (list,), "[lower, upper]", _are_bounds)
    return float(low), float(high)


def _are_bounds(pair: list[Any]) -> bool:
    return len(pair) == 2 and all(is_number(x) or x in ANYWHERE for x in pair) and pair[0] < pair[1]
