"""An arm as the recursions take it: a tree of links, each with its constants."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias, pseudo_inertias
from davinci_forces.maths.mechanics.chain import FIXED, Chain


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
    own = chain.coordinate[:, None] == np.arange(chain.n)
    moves, carried = np.zeros((L + 1, chain.n), np.bool_), np.append(0.0, parameters[:, 0])
    for i in range(L):
        moves[i + 1] = moves[chain.parent[i]] | own[i]
    for i in reversed(range(L)):
        carried[chain.parent[i]] += carried[i + 1]
    still = chain.coordinate == FIXED
    rows = np.column_stack([at[:, :3, :3].reshape(-1, 9), at[:, :3, 3], parameters])
    coordinate = np.where(still, chain.n, chain.coordinate)
    return Tree(chain.n, chain.parent, coordinate, chain.slides | still, moves[1:], carried[1:], rows)


def folded(chain: Chain, parameters: Array) -> tuple[Chain, Array]:
    """The chain without links that do not move: they, and their inertial parameters (L, 10), join their carriers'."""
    pseudo, body, within, kept = pseudo_inertias(parameters), [0], [np.eye(4)], list[int]()
    placement, merged = chain.placement.copy(), list[Array]()
    for i, carrier in enumerate(chain.parent):
        placement[i] = within[carrier] @ chain.placement[i]
        if chain.coordinate[i] != FIXED:
            kept.append(i)
            merged.append(pseudo[i])
            body.append(len(kept))
            within.append(np.eye(4))
        else:
            body.append(body[carrier])
            within.append(placement[i])
            if body[carrier]:
                merged[body[carrier] - 1] = merged[body[carrier] - 1] + placement[i] @ pseudo[i] @ placement[i].T
    fewer = replace(
        chain, links=tuple(chain.links[i] for i in kept), parent=np.array(body)[chain.parent[kept]],
        placement=placement[kept], slides=chain.slides[kept], coordinate=chain.coordinate[kept],
        body=np.array(body)[chain.body], offset=np.array(within)[chain.body] @ chain.offset,
    )  # fmt: skip
    return fewer, of_pseudo_inertias(np.array(merged))
