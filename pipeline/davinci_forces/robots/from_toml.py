"""Read a robot from a laboratory's TOML file, and changes to a listed robot.

`guide/how-to/robot-file.md` describes the file: joints, links and all their keys with units.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces import toml
from davinci_forces.errors import BadRobot
from davinci_forces.maths.mechanics.bodies import Bodies, tensors
from davinci_forces.maths.mechanics.chain import (
    BASE,
    FIXED,
    Chain,
    TableRow,
    denavit_hartenberg,
    modified_denavit_hartenberg,
)
from davinci_forces.maths.models.terms import TERMS, Term
from davinci_forces.robots.robot import ANYWHERE, MOST_JOINTS, UNLIMITED, Joint, Kind, Limits, Robot
from davinci_forces.toml import TomlFile, TomlTable, excerpt, is_number

NAME = re.compile(r"[a-z0-9_-]+")
# Names that Windows reserves for devices, with any suffix; records are files with the names of logs and joints.
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(10))}
KIND_NAMES = tuple(kind.value for kind in Kind)
CONVENTIONS = {"modified": modified_denavit_hartenberg, "classic": denavit_hartenberg}
BASE_NAMES = ("base", BASE)  # names of the frame that carries the first link
WEIGHT_KEYS = ("mass", "centre", "inertia")


def read_with_problems(file: Path) -> tuple[Robot | None, TomlFile]:
    """Read a robot, None if its joints are unknown, and its file with problems; raises BadRobot if it is not TOML."""
    table = toml.read(file, BadRobot, "there is no such robot file")
    return robot_of(table, file.stem), table.file


def robot_of(table: TomlTable, stem: str) -> Robot | None:
    """Build a robot from its table, with problems noted; None if its joints are unknown."""
    name = table.text("name", stem)
    title = table.text("title", name)
    entries = table.tables("joint", "it has no [[joint]]", most=MOST_JOINTS)
    joints = [_joint(entry) for entry in entries]
    table.unique("joint", "name", ((i, joint.name) for i, joint in enumerate(joints) if joint), "two joints are named")
    valid_joints = tuple(joint for joint in joints if joint)
    chain = read_chain(table, valid_joints)
    table.close_all()
    return Robot(name, title, valid_joints, *chain) if valid_joints and len(valid_joints) == len(joints) else None


def wrong_name(name: str) -> str:
    """The problem of the name of a log or a joint, which is used in file names; "" if the name is valid."""
    if not NAME.fullmatch(name):
        return f"{excerpt(name)} may have only lower-case letters, digits, _ and -"
    return f"{name!r} is reserved on Windows; choose another" if name in RESERVED else ""


def _joint(table: TomlTable) -> Joint | None:
    """Read a joint, with problems noted; None if its name or kind is invalid."""
    name = table.text("name")
    wrong = wrong_name(name)
    if wrong and isinstance(table.values.get("name"), str):
        table.problem(f"name {wrong}", "name")
    table.place += "" if wrong else f" ({name})"
    kind = table.text("kind", choices=KIND_NAMES)
    blank = Joint(name, name.replace("_", " ").capitalize(), Kind(kind or KIND_NAMES[0]), (), UNLIMITED)
    joint = change(blank, table)
    if "terms" not in table:
        table.problem(f"terms is missing; it lists the terms of the joint's model, of {', '.join(map(repr, TERMS))}")
    return None if wrong or not kind else joint


def change(joint: Joint, table: TomlTable) -> Joint:
    """Replace the properties of a joint that a table states, with problems noted."""
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
        q_tau=table.number("q_tau", joint.q_tau, low=0.0, expected="a number from 0 on"),
    )
    if changed.title.lower() not in (joint.title.lower(), joint.name.replace("_", " ")):
        table.problem("title is not shown: reports name a joint by its name; change that, or leave title out", "title")
    if changed.effort != joint.effort and "limits" not in table:  # the effort limit is in the old unit
        changed = replace(changed, limits=replace(changed.limits, effort=math.inf))
    if "effort" in table and "torque_constant" in table:
        table.problem("torque_constant is not used where effort is in A; leave one of them out", "torque_constant")
    table.close_all()
    return changed


def _terms(table: TomlTable) -> tuple[Term, ...]:
    names = table.texts("terms", None, TERMS)
    if len(set(names)) < len(names):
        table.problem(f"terms must name no term twice, not {excerpt(list(names))}", "terms")
    return tuple(TERMS[name] for name in names)


def _not_zero(table: TomlTable, key: str, default: float) -> float:
    value = table.take(key, default, (int, float), "a number other than 0", lambda x: x != 0 and is_number(x))
    return float(value) if table.likely(key, (value,)) else default


def _limits(table: TomlTable) -> Limits:
    limits = table.table("limits", like="{ q = [-0.6, 0.6], dq = [-1.2, 1.2] }")

    def are_bounds(pair: list[Any]) -> bool:
        return len(pair) == 2 and all(is_number(x) or x in ANYWHERE for x in pair) and pair[0] < pair[1]

    pairs = [limits.take(name, [*ANYWHERE], (list,), "[lower, upper]", are_bounds) for name in ("q", "dq", "ddq")]
    for name, pair in zip(("q", "dq", "ddq"), pairs, strict=True):
        limits.likely(name, (end for end in pair if end not in ANYWHERE))
    q, dq, ddq = ((float(low), float(high)) for low, high in pairs)
    expected = "the largest effort of the drive"
    stated = "effort" in limits
    effort = limits.number("effort", above=0.0, expected=expected, kind="force") if stated else math.inf
    return Limits(q, dq, ddq, effort)


def read_chain(table: TomlTable, joints: Sequence[Joint]) -> tuple[Chain | None, Bodies | None, tuple[str, ...]]:
    """Read the chain, the bodies if known, and the coordinates beyond the joints, with problems noted; all optional."""
    entries = table.tables("link", most=MOST_JOINTS)
    if not entries:
        return None, None, ()
    convention = table.text("convention", "modified", tuple(CONVENTIONS))
    wrist = tuple(table.take("wrist", [], (list,), "a list of names", lambda names: all(type(x) is str for x in names)))
    kinds = {joint.name: joint.kind for joint in joints}
    coordinates, rows, weights = [*kinds, *wrist], list[TableRow](), list[tuple[float, ...]]()
    for entry in entries:
        rows.append(_row(entry, [*BASE_NAMES, *(row.name for row in rows)], coordinates, kinds))
        weights.append(_weight(entry, rows[-1]))
    table.unique("link", "name", enumerate(row.name for row in rows), "two links are named")
    tip = table.text("tip", rows[-1].name, tuple(row.name for row in rows))
    unmoved = [name for k, name in enumerate(coordinates) if k not in {row.coordinate for row in rows}]
    if unmoved:
        missing = f"no [[link]] has moved_by {', '.join(map(repr, unmoved))}"
        table.problem(f"{missing}; a chain needs a link for every joint: add it, or leave all [[link]] out", "link")
    if len(set(coordinates)) < len(coordinates):
        table.problem("wrist must name each coordinate beyond the joints once", "wrist")
    if table.file.problems():
        return None, None, ()
    chain = CONVENTIONS[convention](rows, tip)
    moving = [weight for row, weight in zip(rows, weights, strict=True) if row.coordinate != FIXED]
    return chain, _bodies(moving, chain) if any(moving) else None, wrist


def _row(table: TomlTable, parents: list[str], coordinates: list[str], kinds: dict[str, Kind]) -> TableRow:
    """Read one row of the Denavit-Hartenberg table; coordinates of the wrist are revolute."""
    name = table.text("name")
    if name in BASE_NAMES:
        table.problem(f"name {name!r} is reserved for the base; choose another", "name")
    on = table.text("on", parents[-1], parents)
    alpha, a, d, theta = (table.number(key, 0.0) for key in ("alpha", "a", "d", "theta"))
    moved_by = table.text("moved_by", "", coordinates) if "moved_by" in table else ""
    sign = table.take("sign", 1, (int,), "1 or -1", lambda x: x in (1, -1))
    coordinate = coordinates.index(moved_by) if moved_by else FIXED
    slides = kinds.get(moved_by) is Kind.PRISMATIC
    return TableRow(name, BASE if on in BASE_NAMES else on, alpha, a, d, theta, coordinate, sign, slides)


def _weight(table: TomlTable, row: TableRow) -> tuple[float, ...]:
    """Read mass, centre and inertia of a link, ten numbers; none if the file does not state them."""
    stated = [key in table for key in WEIGHT_KEYS]  # a list, not a generator, because every key must be looked up
    if not any(stated):
        return ()
    if row.coordinate == FIXED:
        table.problem("a link without moved_by has no mass; add it to the link that carries this one", "mass")
    mass = table.number("mass", low=0.0, expected="a number of kg")
    centre = table.numbers("centre", [0.0] * 3, 3)
    inertia = table.numbers("inertia", [0.0] * 6, 6, "[Ixx, Ixy, Ixz, Iyy, Iyz, Izz]")
    if len(inertia) == 6 and np.linalg.eigvalsh(tensors(np.array([[0.0] * 4 + [*inertia]])))[0, 0] < 0:
        table.problem(f"inertia {excerpt(list(inertia))} has a negative principal moment, which no body has", "inertia")
    return (mass, *centre, *inertia)


def _bodies(weights: Sequence[tuple[float, ...]], chain: Chain) -> Bodies:
    """The bodies of the moving links, in the frames of the dynamics; links without a stated mass have mass 0."""
    stated = np.array([weight or (0.0,) * 10 for weight in weights])
    bodies = Bodies(stated[:, 0], stated[:, 1:4], tensors(stated), np.zeros(len(stated), np.int64))
    return bodies.in_frames(chain.of_links)
