"""The chain of a robot's TOML file: Denavit and Hartenberg's parameters of each link, and what it weighs.

convention = "modified"                # or "classic"
tip = "hand"                           # where its frame is; the last link where nothing is said
wrist = ["grip"]                       # what moves links beyond the joints, and has no effort of its own

[[link]]
name = "upper_arm"
on = "base"                            # what carries it: the base, or a link before this one
alpha = 0.0                            # [rad]
a = 0.0                                # [m]
d = 0.3                                # [m] at q = 0
theta = 0.0                            # [rad] at q = 0
moved_by = "shoulder"                  # a joint or a wrist's; without it the frame is fixed to what carries it
sign = 1                               # -1 where it moves against its joint
mass = 1.2                             # [kg]; with centre [m] and inertia [kg m^2] about it, in the link's own axes
centre = [0.0, 0.0, 0.1]
inertia = [0.01, 0.0, 0.0, 0.01, 0.0, 0.002]    # Ixx, Ixy, Ixz, Iyy, Iyz, Izz
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import (
    BASE,
    FIXED,
    Chain,
    TableRow,
    denavit_hartenberg,
    modified_denavit_hartenberg,
)
from davinci_forces.robots.robot import Joint, Kind
from davinci_forces.toml import TomlTable, shown

CONVENTIONS = {"modified": modified_denavit_hartenberg, "classic": denavit_hartenberg}
BASES = ("base", BASE)  # what the frame that carries the first link is called
WEIGHT = ("mass", "centre", "inertia")


class Carried(NamedTuple):
    """The chain of a robot, what its links weigh where the file says so, and its coordinates beyond the joints."""

    chain: Chain | None = None
    bodies: Bodies | None = None
    wrist: tuple[str, ...] = ()


class _Weight(NamedTuple):
    mass: float
    centre: tuple[float, ...]
    inertia: tuple[float, ...]


def read(table: TomlTable, joints: Sequence[Joint]) -> Carried:
    """The chain that a robot's file describes, what is wrong with it noted; nothing where it has no [[link]]."""
    entries = table.tables("link")
    if not entries:
        return Carried()
    convention = table.text("convention", "modified", tuple(CONVENTIONS))
    wrist = tuple(table.take("wrist", [], (list,), "a list of names", lambda names: all(type(x) is str for x in names)))
    kinds = {joint.name: joint.kind for joint in joints}
    known, rows, weights = [*kinds, *wrist], list[TableRow](), list[_Weight | None]()
    for entry in entries:
        rows.append(_row(entry, [*BASES, *(row.name for row in rows)], known, kinds))
        weights.append(_weight(entry, rows[-1]))
        entry.close()
    table.unique("link", "name", enumerate(row.name for row in rows), "two links are named")
    tip = table.text("tip", rows[-1].name, tuple(row.name for row in rows))
    unmoved = [name for k, name in enumerate(known) if k not in {row.coordinate for row in rows}]
    if unmoved:
        said = f"no [[link]] is moved_by {', '.join(map(repr, unmoved))}"
        table.problem(f"{said}; a chain has a link for every joint, so add it, or leave all [[link]] out", "link")
    if len(set(known)) < len(known):
        table.problem("wrist names what moves beyond the joints, each once", "wrist")
    if table.file.problems():
        return Carried()
    chain = CONVENTIONS[convention](rows, tip)
    moving = [weight for row, weight in zip(rows, weights, strict=True) if row.coordinate != FIXED]
    return Carried(chain, _bodies(moving, chain) if any(moving) else None, wrist)


def _row(table: TomlTable, carriers: list[str], known: list[str], kinds: dict[str, Kind]) -> TableRow:
    """One row of the table; a coordinate of the wrist turns its links."""
    name = table.text("name")
    if name in BASES:
        table.problem(f"name {name!r} is the base's; choose another", "name")
    on = table.text("on", carriers[-1], carriers)
    alpha, a, d, theta = (table.number(key, 0.0) for key in ("alpha", "a", "d", "theta"))
    moved_by = table.text("moved_by", "", known) if "moved_by" in table else ""
    sign = table.take("sign", 1, (int,), "1 or -1", lambda x: x in (1, -1))
    coordinate = known.index(moved_by) if moved_by else FIXED
    slides = kinds.get(moved_by) is Kind.PRISMATIC
    return TableRow(name, BASE if on in BASES else on, alpha, a, d, theta, coordinate, sign, slides)


def _weight(table: TomlTable, row: TableRow) -> _Weight | None:
    """What a link weighs; None where the file does not say."""
    asked = [key in table for key in WEIGHT]  # of all of them, which makes them known
    if not any(asked):
        return None
    if row.coordinate == FIXED:
        table.problem("nothing moves it, so it weighs with what carries it: give that its mass", "mass")
    mass = table.number("mass", low=0.0, words="a number of kg")
    centre = table.numbers("centre", [0.0] * 3, 3)
    inertia = table.numbers("inertia", [0.0] * 6, 6, "[Ixx, Ixy, Ixz, Iyy, Iyz, Izz]")
    if len(inertia) == 6 and np.linalg.eigvalsh(_tensor(inertia))[0] < 0:
        table.problem(f"no body has the inertia {shown(list(inertia))}: a principal moment is negative", "inertia")
    return _Weight(mass, centre, inertia)


def _tensor(inertia: Sequence[float]) -> Array:
    xx, xy, xz, yy, yz, zz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _bodies(weights: Sequence[_Weight | None], chain: Chain) -> Bodies:
    """The bodies of the links that move, in the frames that the dynamics take; what is not said weighs nothing."""
    each = [weight or _Weight(0.0, (0.0,) * 3, (0.0,) * 6) for weight in weights]
    return Bodies(
        np.array([weight.mass for weight in each]),
        np.array([weight.centre for weight in each]),
        np.array([_tensor(weight.inertia) for weight in each]),
        np.zeros(len(each), np.int64),
    ).within(chain.of_links)
