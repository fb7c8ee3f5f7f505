"""What carries and what moves each link of an arm: a chain that may branch, and whose links may share a coordinate.

Every link has a frame at its joint, whose z is the axis: the link's pose in its carrier's is its placement times Rz(q),
or Tz(q).  One coordinate may move several links (a parallelogram's), and several links may hang on one (two jaws).
Further frames, by name, are fixed to links.  Bodies are numbered from the base, which is 0: link i is body i + 1.
Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4.

A chain is described by the placements themselves, or by a table of Denavit and Hartenberg's parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array

FIXED = -1  # the coordinate of what nothing moves
BASE = "0"


class TableRow(NamedTuple):
    """One frame of a table of Denavit and Hartenberg's parameters; what nothing moves is fixed to its carrier."""

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

    def reduced(self, n: int) -> "Chain":
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

    def lengthened(self, link: str, by: float) -> "Chain":
        """The same arm with a link, and all that it carries, further out along its own axis [m].

        A table says so in the d of that row, where the row has the link's axis: in modified parameters.
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
        """The frames that bear the links' names, in the links' own (L, 4, 4) [m]: where a table has its links."""
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
    """The chain of a table, with what lies before and after the motion of each row."""
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
