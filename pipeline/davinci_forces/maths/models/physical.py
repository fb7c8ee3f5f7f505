"""The physical parameters behind a joint model: masses, centres of mass, moments of inertia, rotor and friction.

    theta = C m(x),    m(x) monomials such as m_3, m_3 l_c3, m_3 l_c3^2             (6.7), (6.10), (6.13)

A joint model has fewer parameters than x, so they do not determine x; a search varies x within bounds.  C is derived
from the chain, in which only this joint moves.
"""

from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.bodies import Bodies, Drives
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.rigid_body import gravity, mass_matrix
from davinci_forces.maths.models import terms

POSES = np.linspace(-0.6, 0.6, 7)  # [rad] or [m]: three poses determine the coefficients, the others confirm them
AGREEMENT = 1e-9  # largest relative deviation of the chain's M and G from the joint model
ROUNDING = 1e-12  # a coefficient of C of at most this size is 0


class Quality(Enum):
    """The kind of a physical parameter."""

    MASS = "mass"
    CENTRE = "distance of the centre of mass"
    MOMENT = "moment of inertia"
    ROTOR = "inertia of the rotor"
    VISCOUS = "viscous friction"
    COULOMB = "Coulomb friction"


class Physical(NamedTuple):
    """One physical parameter, its initial guess, and its bounds in the search."""

    name: str
    quality: Quality
    guess: float
    lower: float
    upper: float
    link: str = ""  # link of the parameter; "" for rotor and friction
    axis: int = 0  # axis of the link's frame, for a moment or a centre; a centre lies on its negative side


@dataclass(frozen=True, eq=False)
class PhysicalTable:
    """The physical parameters of one joint, and the chain that determines C."""

    chain: Chain
    joint: int  # index, from 0
    parameters: tuple[Physical, ...]


class Lumping(NamedTuple):
    """The p parameters as functions of n physical ones: theta = C m(x)."""

    factors: Integers  # (T, 3): indices of the parameters that each monomial multiplies; the index n stands for 1
    coefficients: Array  # C (p, T)

    def theta(self, x: Array) -> Array:
        """The model parameters (..., p) for physical parameters (..., n)."""
        extended = np.concatenate([x, np.ones((*x.shape[:-1], 1))], axis=-1)
        return np.asarray(extended[..., self.factors].prod(axis=-1) @ self.coefficients.T)


class Box(NamedTuple):
    """A search space: bounds of n parameters, and the p model parameters as functions of them."""

    lower: Array  # (n,)
    upper: Array  # (n,)
    lumping: Lumping


def reduced_parameters(
    chain: Chain, bodies: Bodies, joint: int, n: int = 3, drives: Drives | None = None
) -> dict[str, float]:
    """Parameters of a joint's terms, by name, with the other joints held at 0.

    `joint` is an index from 0.  The arm has n coordinates; the second jaw is included for n = 7.  A revolute joint has
    inertia, gravity sine and cosine.  A prismatic joint has a lifted mass and the inertia of its rotor.  With drives,
    there is also viscous and Coulomb friction.

    Raises ValueError if the inertia or gravity of the chain does not follow these terms.
    """
    q = np.zeros((len(POSES), n))
    q[:, joint] = POSES
    M = mass_matrix(chain, bodies, q)[:, joint, joint]
    G = gravity(chain, bodies, q)[:, joint] / GRAVITY
    slides = bool(chain.slides[chain.coordinate == joint].all())
    columns = [-np.ones_like(POSES)] if slides else [np.sin(POSES), np.cos(POSES)]
    theta = np.linalg.lstsq(np.column_stack(columns), G, rcond=None)[0]
    if np.ptp(M) > AGREEMENT * M.max() or np.abs(np.column_stack(columns) @ theta - G).max() > AGREEMENT * M.max():
        raise ValueError(f"joint {joint} moving alone is not of the form of (6.8), (6.11) or (6.13)")
    rotor = 0.0 if drives is None else float(drives.inertia[joint])
    if slides:
        values = {terms.lifted_mass: theta[0], terms.inertia: M[0] - theta[0] + rotor}
    else:
        values = {terms.inertia: M[0] + rotor, terms.gravity_sin: theta[0], terms.gravity_cos: theta[1]}
    if drives is not None:
        values |= {terms.viscous: drives.viscous[joint], terms.coulomb: drives.coulomb[joint]}
    return {term.name: float(value) for term, value in values.items()}


@cache  # every task needs it
def physical_lumping(table: PhysicalTable, gear_ratio: float, names: tuple[str, ...]) -> Lumping | None:
    """How physical parameters determine those of a joint's model, by the chain; None if these are not `names`."""
    unit, place = len(table.parameters), {(x.quality, x.link): i for i, x in enumerate(table.parameters)}
    monomials = list[tuple[tuple[int, int, int], dict[str, float]]]()
    for i, x in enumerate(table.parameters):
        match x.quality:
            case Quality.MASS:
                centre = place.get((Quality.CENTRE, x.link), unit)
                axis = table.parameters[centre].axis if centre < unit else 0
                back, at, ahead = (of_link(table, x.link, mass=1.0, centre=-c, axis=axis) for c in (-1.0, 0.0, 1.0))
                monomials.append(((i, unit, unit), at))
                if centre < unit:
                    monomials.append(((i, centre, unit), {k: (ahead[k] - back[k]) / 2 for k in at}))
                    monomials.append(((i, centre, centre), {k: (ahead[k] + back[k]) / 2 - at[k] for k in at}))
            case Quality.MOMENT:
                monomials.append(((i, unit, unit), of_link(table, x.link, moment=1.0, axis=x.axis)))
            case Quality.ROTOR:
                monomials.append(((i, unit, unit), {terms.inertia.name: gear_ratio**2}))
            case Quality.VISCOUS | Quality.COULOMB:
                monomials.append(((i, unit, unit), {x.quality.value: 1.0}))
    determined = {name for _, part in monomials for name, value in part.items() if abs(value) > ROUNDING}
    if determined != set(names):
        return None
    coefficients = np.array([[part.get(name, 0.0) for _, part in monomials] for name in names])
    return Lumping(np.array([factors for factors, _ in monomials]), coefficients)


def of_link(
    table: PhysicalTable, link: str, mass: float = 0.0, centre: float = 0.0, moment: float = 0.0, axis: int = 0
) -> dict[str, float]:
    """Parameters of the joint if only this link has mass or inertia."""
    chain = table.chain
    L, which = len(chain.links), chain.links.index(link)
    masses, centres, inertias = np.zeros(L), np.zeros((L, 3)), np.zeros((L, 3, 3))
    masses[which], centres[which, axis], inertias[which, axis, axis] = mass, centre, moment
    bodies = Bodies(masses, centres, inertias, np.zeros(L, np.int64)).in_frames(chain.of_links)
    return reduced_parameters(chain, bodies, table.joint)
