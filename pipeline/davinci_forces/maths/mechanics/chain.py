"""The kinematic tree of an arm: it may branch, and several links may share a coordinate.

Every link has a frame at its joint, with z along the joint axis.  The pose of a link relative to its parent is its
placement times Rz(q) or Tz(q).  One coordinate may move several links, as in a parallelogram.  A link may have several
children, such as two jaws.  Named frames are fixed to links.  The base is body 0, and link i is body i + 1.
Gravity acts against `up`: the z axis of the base unless the base is mounted on a wall, a ceiling or a slope.
Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4.

With the inertial parameters of its links, a chain gives the `Tree` that the recursions take.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import PARAMETERS, of_pseudo_inertias, pseudo_inertias

FIXED = -1  # the coordinate of links that do not move
BASE = "0"
Z_AXIS = (0.0, 0.0, 1.0)


class TableRow(NamedTuple):
    """One frame of a table of Denavit-Hartenberg parameters; without a coordinate, it is fixed to its parent frame."""

    name: str
    before: str  # parent frame
    alpha: float  # [rad]
    a: float  # [m]
    d: float  # [m] at q = 0
    theta: float  # [rad] at q = 0
    coordinate: int = FIXED  # index in q of the coordinate that moves this frame
    sign: int = 1  # -1 where the coordinate is subtracted
    slides: bool = False  # whether the coordinate is added to d, not to theta


@dataclass(frozen=True, eq=False)
class Chain:
    """The L links of an arm with n coordinates, and its F named frames."""

    links: tuple[str, ...]  # (L,)
    parent: NDArray[np.int64]  # parent body of each link (L,)
    placement: Array  # pose of each link in its parent's frame at q = 0 (L, 4, 4) [m]
    slides: NDArray[np.bool_]  # whether the joint is prismatic (L,)
    coordinate: NDArray[np.int64]  # index in q of the coordinate that moves each link, or FIXED (L,)
    names: tuple[str, ...]  # names of the frames, the base first (F,)
    body: NDArray[np.int64]  # body to which each frame is fixed (F,)
    offset: Array  # pose of each frame in the frame of its body (F, 4, 4) [m]
    before: NDArray[np.int64]  # parent frame of each frame, to which a drawing connects it (F,)
    tip: str  # name of the frame whose origin is the tip
    n: int  # coordinates
    table: tuple[TableRow, ...] = ()  # rows of all frames after the base, if the chain was built from a table
    up: tuple[float, float, float] = Z_AXIS  # direction against gravity, of length 1, in base axes

    def with_coordinates(self, n: int) -> "Chain":
        """The same arm with its first n coordinates, all later ones fixed at 0; raises ValueError if it has fewer."""
        if n == self.n:
            return self
        if not 0 < n < self.n:
            raise ValueError(f"the chain has {self.n} coordinates, and q has {n}")
        return replace(self, n=n, coordinate=np.where(self.coordinate < n, self.coordinate, FIXED))

    def lengthen(self, link: str, extension: float) -> "Chain":
        """The same arm with a link and its descendants moved by `extension` [m] along its axis: d of the link's row."""
        i, placement = self.links.index(link), self.placement.copy()
        placement[i, :3, 3] += extension * placement[i, :3, 2]
        table = tuple(row._replace(d=row.d + extension) if row.name == link else row for row in self.table)
        return replace(self, placement=placement, table=table)

    @property
    def moved_by(self) -> NDArray[np.int64]:
        """The coordinate that moves each frame relative to its parent frame, or FIXED (F,)."""
        moved = self.body != self.body[self.before]
        return np.where(moved, np.append(FIXED, self.coordinate)[self.body], FIXED)

    @property
    def of_links(self) -> Array:
        """For each link, the pose of the named frame of the same name in the link's frame (L, 4, 4) [m]."""
        return np.asarray(self.offset[[self.names.index(link) for link in self.links]])


class ChainFrame(NamedTuple):
    """One frame of an arm, and its inertial parameters; without a coordinate, it is fixed to its parent frame."""

    name: str
    before: int  # index of the parent frame: the base is 0
    first: Array  # pose of its joint in the parent frame (4, 4) [m]
    last: Array  # pose of the frame in the axes of its joint at q = 0 (4, 4) [m]
    coordinate: int
    slides: bool
    parameters: Array = np.zeros(len(PARAMETERS))  # (10,), in the axes of its joint


def chain_of(base: str, frames: Sequence[ChainFrame], tip: str) -> tuple[Chain, Array]:
    """The chain of these frames, and the inertial parameters (L, 10) of its links.

    Fixed frames add their inertia to their parent, except on the base.
    """
    before, coordinate = [frame.before for frame in frames], np.array([frame.coordinate for frame in frames])
    names, offset = (base, *(frame.name for frame in frames)), np.stack([np.eye(4), *(frame.last for frame in frames)])
    chain = Chain(
        links=names[1:], parent=np.array(before), placement=offset[before] @ [frame.first for frame in frames],
        slides=np.array([frame.slides for frame in frames]), coordinate=coordinate, names=names,
        body=np.arange(len(names)), offset=offset, before=np.array([0, *before]), tip=tip, n=int(coordinate.max()) + 1,
    )  # fmt: skip
    return fold_fixed_links(chain, np.array([frame.parameters for frame in frames]))


def denavit_hartenberg(table: Sequence[TableRow], tip: str) -> Chain:
    """The chain of a table of classic parameters, T = Rz(theta) Tz(d) Tx(a) Rx(alpha).  (3.7)

    A link turns about z of its parent frame, and its own frame is at its far end.
    """
    transforms = [(np.eye(4), _screw(2, row.theta, row.d) @ _screw(0, row.alpha, row.a)) for row in table]
    return _chain_of_table(table, tip, transforms)


def modified_denavit_hartenberg(table: Sequence[TableRow], tip: str) -> Chain:
    """The chain of a table of modified parameters, T = Rx(alpha) Tx(a) Rz(theta) Tz(d).

    A link turns about z of its own frame.  Craig, Introduction to Robotics, section 3.4.
    """
    transforms = [(_screw(0, row.alpha, row.a) @ _screw(2, row.theta, row.d), np.eye(4)) for row in table]
    return _chain_of_table(table, tip, transforms)


def _chain_of_table(table: Sequence[TableRow], tip: str, transforms: list[tuple[Array, Array]]) -> Chain:
    """The chain of a table; each row has a transform before the motion of its joint and one after."""
    names, frames = [BASE, *(row.name for row in table)], list[ChainFrame]()
    for row, (first, last) in zip(table, transforms, strict=True):
        flip = np.diag([1.0, row.sign, row.sign, 1.0])  # reverses the axis: Rz(-q) = Rx(pi) Rz(q) Rx(pi)
        before = names.index(row.before)
        frames.append(ChainFrame(row.name, before, first @ flip, flip @ last, row.coordinate, row.slides))
    return replace(chain_of(BASE, frames, tip)[0], table=tuple(table))


def _screw(axis: int, angle: float, length: float) -> Array:
    """The transform (4, 4) of a turn [rad] about and a shift [m] along one axis."""
    T, (i, j) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i], T[axis, 3] = -np.sin(angle), np.sin(angle), length
    return T


class Tree(NamedTuple):
    """The tree of L links and n coordinates: arrays for compiled code, lists for numpy code.

    The base is body 0, and link i is body i + 1.  Links that never move have the coordinate n, whose value is always 0.
    """

    n: int
    parent: Any  # (L,) parent body of each link
    coordinate: Any  # (L,) index of the coordinate that moves each link
    slides: Any  # (L,) whether the joint is prismatic
    moves: Any  # (L, n) whether a coordinate moves the link, itself or through an ancestor
    rows: Any  # (L, 22) rotation and position in the parent's frame at q = 0, and inertial parameters
    up: Any  # (3,) direction against gravity in base axes

    def lists(self) -> "Tree":
        """The same tree, with lists in place of arrays."""
        return Tree(self.n, *(values.tolist() for values in self[1:]))


def tree_of(chain: Chain, parameters: Array) -> Tree:
    """The tree of a chain whose links have these inertial parameters (L, 10)."""
    L, T = len(chain.parent), chain.placement
    drives = chain.coordinate[:, None] == np.arange(chain.n)
    moves = np.zeros((L + 1, chain.n), np.bool_)
    for i in range(L):
        moves[i + 1] = moves[chain.parent[i]] | drives[i]
    still = chain.coordinate == FIXED
    rows = np.column_stack([T[:, :3, :3].reshape(-1, 9), T[:, :3, 3], parameters])
    coordinate = np.where(still, chain.n, chain.coordinate)
    slides = chain.slides | still
    return Tree(chain.n, chain.parent, coordinate, slides, moves[1:], rows, np.array(chain.up))


def fold_fixed_links(chain: Chain, parameters: Array) -> tuple[Chain, Array]:
    """Merge links that do not move, and their inertial parameters (L, 10), into their parent links."""
    moves = chain.coordinate != FIXED
    pseudo, merged = pseudo_inertias(parameters), np.zeros((np.count_nonzero(moves) + 1, 4, 4))
    body, within, placement = [0], [np.eye(4)], chain.placement.copy()
    for i, (parent, link) in enumerate(zip(chain.parent, np.cumsum(moves), strict=True)):
        placement[i] = within[parent] @ chain.placement[i]
        body.append(link if moves[i] else body[parent])
        within.append(np.eye(4) if moves[i] else placement[i])
        merged[body[-1]] += within[-1] @ pseudo[i] @ within[-1].T
    folded = replace(
        chain, links=tuple(compress(chain.links, moves)), parent=np.array(body)[chain.parent[moves]],
        placement=placement[moves], slides=chain.slides[moves], coordinate=chain.coordinate[moves],
        body=np.array(body)[chain.body], offset=np.array(within)[chain.body] @ chain.offset,
    )  # fmt: skip
    return folded, of_pseudo_inertias(merged[1:])
