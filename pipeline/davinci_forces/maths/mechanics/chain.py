"""The kinematic tree of an arm: a chain that may branch, and whose links may share a coordinate.

Every link has a frame at its joint, whose z is the axis: the link's pose in its carrier's is its placement times Rz(q),
or Tz(q).  One coordinate may move several links (a parallelogram's), and one link may carry several (two jaws).
Further frames, by name, are fixed to links.  Bodies are numbered from the base, which is 0: link i is body i + 1.
Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4.

A chain is described by the placements themselves, or by a table of Denavit and Hartenberg's parameters.  Together with
the inertial parameters of its links it makes the tree for the recursions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias, pseudo_inertias

FIXED = -1  # the coordinate of links that do not move
BASE = "0"


class TableRow(NamedTuple):
    """One frame of a table of Denavit and Hartenberg's parameters; without a coordinate, it is fixed to its carrier."""

    name: str
    before: str  # frame that carries it
    alpha: float  # [rad]
    a: float  # [m]
    d: float  # [m] at q = 0
    theta: float  # [rad] at q = 0
    coordinate: int = FIXED  # index in q of the coordinate that moves it
    sign: int = 1  # -1 where the coordinate is subtracted
    slides: bool = False  # whether the coordinate is a part of d rather than of theta


@dataclass(frozen=True, eq=False)
class Chain:
    """The L links of an arm with n coordinates, and its F named frames."""

    links: tuple[str, ...]  # (L,)
    parent: NDArray[np.int64]  # body that carries each link (L,)
    placement: Array  # from the carrier's frame to the link's at q = 0 (L, 4, 4) [m]
    slides: NDArray[np.bool_]  # along z, rather than turns about it (L,)
    coordinate: NDArray[np.int64]  # index in q of the coordinate that moves it, or FIXED (L,)
    names: tuple[str, ...]  # of the frames, the base first (F,)
    body: NDArray[np.int64]  # that each frame is fixed to (F,)
    offset: Array  # each frame in its body's (F, 4, 4) [m]
    before: NDArray[np.int64]  # frame that each frame hangs on, as a drawing shows it (F,)
    tip: str  # frame whose origin is the tip
    n: int  # coordinates
    table: tuple[TableRow, ...] = ()  # of the frames after the base, where the chain was described by one

    def with_coordinates(self, n: int) -> "Chain":
        """The same arm with all coordinates after the first n at rest at 0.

        Raises
        ------
        ValueError
            If it has fewer than n coordinates.
        """
        if n == self.n:
            return self
        if not 0 < n < self.n:
            raise ValueError(f"the chain has {self.n} coordinates, and q has {n}")
        return replace(self, n=n, coordinate=np.where(self.coordinate < n, self.coordinate, FIXED))

    def lengthen(self, link: str, by: float) -> "Chain":
        """The same arm with a link, and all that it carries, further out along its own axis [m].

        In a table of modified parameters, whose rows have the links' axes, d of that row changes.
        """
        i, placement = self.links.index(link), self.placement.copy()
        placement[i, :3, 3] += by * placement[i, :3, 2]
        table = tuple(row._replace(d=row.d + by) if row.name == link else row for row in self.table)
        return replace(self, placement=placement, table=table)

    @property
    def moved_by(self) -> NDArray[np.int64]:
        """The coordinate that moves each frame in the one before it, or FIXED (F,)."""
        moved = self.body != self.body[self.before]
        return np.where(moved, np.append(FIXED, self.coordinate)[self.body], FIXED)

    @property
    def of_links(self) -> Array:
        """The frames with the links' names, relative to the links' own (L, 4, 4) [m]: the frames of a table."""
        return np.asarray(self.offset[[self.names.index(link) for link in self.links]])


def denavit_hartenberg(table: Sequence[TableRow], tip: str) -> Chain:
    """The chain of a table of classic parameters, T = Rz(theta) Tz(d) Tx(a) Rx(alpha).  (3.7)

    A link turns about z of the frame that carries it, and bears its own frame at its other end.
    """
    return _described(
        table, tip, [(np.eye(4), _screw(2, row.theta, row.d) @ _screw(0, row.alpha, row.a)) for row in table]
    )


def modified_denavit_hartenberg(table: Sequence[TableRow], tip: str) -> Chain:
    """The chain of a table of modified parameters, T = Rx(alpha) Tx(a) Rz(theta) Tz(d).

    A link turns about z of its own frame.  Craig, Introduction to Robotics, section 3.4.
    """
    return _described(
        table, tip, [(_screw(0, row.alpha, row.a) @ _screw(2, row.theta, row.d), np.eye(4)) for row in table]
    )


def _described(table: Sequence[TableRow], tip: str, around: list[tuple[Array, Array]]) -> Chain:
    """The chain of a table, with the transforms before and after the motion of each row."""
    names, body, offset, before = [BASE], [0], [np.eye(4)], [0]
    parent, placement, moving = list[int](), list[Array](), list[TableRow]()
    for row, (first, last) in zip(table, around, strict=True):
        carrier = names.index(row.before)
        placed, at = offset[carrier] @ first, body[carrier]
        if row.coordinate == FIXED:
            last = placed @ last
        else:
            flipped = np.diag([1.0, row.sign, row.sign, 1.0])  # turns the axis round: Rz(-q) = Rx(pi) Rz(q) Rx(pi)
            parent.append(at)
            placement.append(placed @ flipped)
            moving.append(row)
            at, last = len(moving), flipped @ last
        names.append(row.name)
        body.append(at)
        offset.append(last)
        before.append(carrier)
    coordinate = np.array([row.coordinate for row in moving])
    return Chain(
        links=tuple(row.name for row in moving), parent=np.array(parent), placement=np.array(placement),
        slides=np.array([row.slides for row in moving]), coordinate=coordinate, names=tuple(names),
        body=np.array(body), offset=np.array(offset), before=np.array(before), tip=tip, n=int(coordinate.max()) + 1,
        table=tuple(table),
    )  # fmt: skip


def _screw(axis: int, angle: float, length: float) -> Array:
    """A turn about, and a shift along, one axis (4, 4)."""
    T, (i, j) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i], T[axis, 3] = -np.sin(angle), np.sin(angle), length
    return T


class Tree(NamedTuple):
    """The tree of L links and n coordinates: arrays for compiled code, lists for others.

    Bodies are numbered from the base, which is 0: link i is body i + 1.  A link with coordinate n never moves: lists of
    coordinates have a 0 at that place.
    """

    n: int
    parent: Any  # (L,) body that carries each link
    coordinate: Any  # (L,) that moves it
    slides: Any  # (L,) along z, rather than turns about it
    moves: Any  # (L, n) whether a coordinate moves it, or one of its carriers
    carried: Any  # (L,) mass of it and all that it carries [kg]
    rows: Any  # (L, 22) rotation and place in the carrier at q = 0, and inertial parameters

    def lists(self) -> "Tree":
        """The same, as lists."""
        return Tree(self.n, *(values.tolist() for values in self[1:]))


def tree_of(chain: Chain, parameters: Array) -> Tree:
    """The tree of a chain whose links have these inertial parameters (L, 10)."""
    L, at = len(chain.parent), chain.placement
    drives = chain.coordinate[:, None] == np.arange(chain.n)
    moves, carried = np.zeros((L + 1, chain.n), np.bool_), np.append(0.0, parameters[:, 0])
    for i in range(L):
        moves[i + 1] = moves[chain.parent[i]] | drives[i]
    for i in reversed(range(L)):
        carried[chain.parent[i]] += carried[i + 1]
    still = chain.coordinate == FIXED
    rows = np.column_stack([at[:, :3, :3].reshape(-1, 9), at[:, :3, 3], parameters])
    coordinate = np.where(still, chain.n, chain.coordinate)
    return Tree(chain.n, chain.parent, coordinate, chain.slides | still, moves[1:], carried[1:], rows)


def fold_fixed_links(chain: Chain, parameters: Array) -> tuple[Chain, Array]:
    """Merge links that do not move, and their inertial parameters (L, 10), into their carriers."""
    pseudo, body, within, movable = pseudo_inertias(parameters), [0], [np.eye(4)], list[int]()
    placement, merged = chain.placement.copy(), list[Array]()
    for i, carrier in enumerate(chain.parent):
        placement[i] = within[carrier] @ chain.placement[i]
        if chain.coordinate[i] != FIXED:
            movable.append(i)
            merged.append(pseudo[i])
            body.append(len(movable))
            within.append(np.eye(4))
        else:
            body.append(body[carrier])
            within.append(placement[i])
            if body[carrier]:
                merged[body[carrier] - 1] = merged[body[carrier] - 1] + placement[i] @ pseudo[i] @ placement[i].T
    fewer = replace(
        chain, links=tuple(chain.links[i] for i in movable), parent=np.array(body)[chain.parent[movable]],
        placement=placement[movable], slides=chain.slides[movable], coordinate=chain.coordinate[movable],
        body=np.array(body)[chain.body], offset=np.array(within)[chain.body] @ chain.offset,
    )  # fmt: skip
    return fewer, of_pseudo_inertias(np.array(merged))
