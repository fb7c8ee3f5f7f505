"""What the parameters of a joint's model are made of: masses, their centres, moments of inertia, the motor.

    theta = C m(x),    m(x) monomials such as m_3, m_3 l_c3, m_3 l_c3^2             (6.7), (6.10), (6.13)

A joint's few parameters do not tell the many physical ones apart; they are what a search in a box moves.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.mechanics.chain import Chain


class Quality(Enum):
    """What a physical parameter is."""

    MASS = "mass"
    CENTRE = "distance of the centre of mass"
    MOMENT = "moment of inertia"
    ROTOR = "inertia of the rotor"
    VISCOUS = "viscous friction"
    COULOMB = "Coulomb friction"


class Physical(NamedTuple):
    """One physical parameter, what it is guessed to be, and the box that it is searched in."""

    name: str
    quality: Quality
    guess: float
    lower: float
    upper: float
    link: str = ""  # which it is of, unless it is the motor's
    axis: int = 0  # of the link's frame in the table of the chain, of a moment or a centre, which lies on its far side


@dataclass(frozen=True, eq=False)
class PhysicalTable:
    """The physical parameters of one joint, and the chain that says how they enter."""

    chain: Chain
    joint: int  # counted from 0
    coordinates: int  # of the chain, n
    parameters: tuple[Physical, ...]


class Lumping(NamedTuple):
    """How n physical parameters make p: theta = C m(x)."""

    factors: Integers  # (T, 3): the parameters whose product a monomial is; n stands for 1
    coefficients: Array  # C (p, T)

    def theta(self, x: Array) -> Array:
        """The parameters (..., p) of physical ones (..., n)."""
        extended = np.concatenate([x, np.ones((*x.shape[:-1], 1))], axis=-1)
        return np.asarray(extended[..., self.factors].prod(axis=-1) @ self.coefficients.T)


class Box(NamedTuple):
    """What is searched: n parameters between bounds, which make the p of the model."""

    lower: Array  # (n,)
    upper: Array  # (n,)
    lumping: Lumping


def each_for_itself(n: int) -> Lumping:
    """Parameters that are searched as they are: theta = x."""
    return Lumping(np.column_stack([np.arange(n), np.full((n, 2), n)]), np.eye(n))
