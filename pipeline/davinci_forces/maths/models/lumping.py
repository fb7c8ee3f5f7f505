"""The parameters of a joint that moves alone, out of the chain: what (6.7), (6.10) and (6.13) write out by hand.

theta = C m(x),    m(x) monomials such as m_3, m_3 l_c3, m_3 l_c3^2             (6.7), (6.10), (6.13)
"""

from functools import cache

import numpy as np

from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.bodies import Bodies, Drives
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.rigid_body import gravity, mass_matrix
from davinci_forces.maths.models import terms
from davinci_forces.maths.models.physical import Lumping, PhysicalTable, Quality

REACH = np.linspace(-0.6, 0.6, 7)  # [rad] or [m]: three poses determine the coefficients, the rest confirm them
AGREEMENT = 1e-9
ROUNDING = 1e-12  # below which a parameter does not enter


def reduced_parameters(
    chain: Chain, bodies: Bodies, joint: int, n: int = 3, drives: Drives | None = None
) -> dict[str, float]:
    """Parameters of a joint's terms, by the names of `maths.terms`, with the other joints held at 0.

    `joint` counts from 0; the arm has n coordinates, which decides whether the second jaw counts.  Revolute: inertia,
    gravity sine and cosine; prismatic: lifted mass, and the inertia beyond it, which only drives have.  With drives,
    viscous and Coulomb friction too.

    Raises
    ------
    ValueError
        If the joint's inertia or gravity is not of this form.
    """
    q = np.zeros((len(REACH), n))
    q[:, joint] = REACH
    M = mass_matrix(chain, bodies, q)[:, joint, joint]
    G = gravity(chain, bodies, q)[:, joint] / GRAVITY
    slides = bool(chain.slides[chain.coordinate == joint].all())
    columns = [-np.ones_like(REACH)] if slides else [np.sin(REACH), np.cos(REACH)]
    theta = np.linalg.lstsq(np.column_stack(columns), G, rcond=None)[0]
    if np.ptp(M) > AGREEMENT * M.max() or np.abs(np.column_stack(columns) @ theta - G).max() > AGREEMENT * M.max():
        raise ValueError(f"joint {joint} moving alone is not of the form of (6.8), (6.11) or (6.13)")
    rotor = 0.0 if drives is None else float(drives.inertia[joint])
    if slides:
        found = {terms.lifted_mass.name: float(theta[0]), terms.inertia.name: float(M[0] - theta[0]) + rotor}
    else:
        gravities = {terms.gravity_sin.name: float(theta[0]), terms.gravity_cos.name: float(theta[1])}
        found = {terms.inertia.name: float(M[0]) + rotor, **gravities}
    if drives is not None:
        found |= {terms.viscous.name: float(drives.viscous[joint]), terms.coulomb.name: float(drives.coulomb[joint])}
    return found


@cache
def lumping(table: PhysicalTable, gear_ratio: float, names: tuple[str, ...]) -> Lumping | None:
    """How a joint's physical parameters make those of its model, derived from the chain.

    None where the table does not make the parameters that are named, and no others.  Kept for each table, as every
    task asks for it again.
    """
    one, place = len(table.parameters), {(x.quality, x.link): i for i, x in enumerate(table.parameters)}
    made = list[tuple[tuple[int, int, int], dict[str, float]]]()
    for i, x in enumerate(table.parameters):
        match x.quality:
            case Quality.MASS:
                centre = place.get((Quality.CENTRE, x.link), one)
                axis = table.parameters[centre].axis if centre < one else 0
                back, at, ahead = (alone(table, x.link, mass=1.0, centre=-c, axis=axis) for c in (-1.0, 0.0, 1.0))
                made.append(((i, one, one), at))
                if centre < one:
                    made.append(((i, centre, one), {k: (ahead[k] - back[k]) / 2 for k in at}))
                    made.append(((i, centre, centre), {k: (ahead[k] + back[k]) / 2 - at[k] for k in at}))
            case Quality.MOMENT:
                made.append(((i, one, one), alone(table, x.link, moment=1.0, axis=x.axis)))
            case Quality.ROTOR:
                made.append(((i, one, one), {terms.inertia.name: gear_ratio**2}))
            case Quality.VISCOUS | Quality.COULOMB:
                made.append(((i, one, one), {x.quality.value: 1.0}))
    entering = {name for _, part in made for name, value in part.items() if abs(value) > ROUNDING}
    if entering != set(names):
        return None
    coefficients = np.array([[part.get(name, 0.0) for _, part in made] for name in names])
    return Lumping(np.array([factors for factors, _ in made]), coefficients)


def alone(
    table: PhysicalTable, link: str, mass: float = 0.0, centre: float = 0.0, moment: float = 0.0, axis: int = 0
) -> dict[str, float]:
    """The parameters of a joint that carries one link, and nothing else."""
    chain = table.chain
    L, which = len(chain.links), chain.links.index(link)
    masses, centres, inertias = np.zeros(L), np.zeros((L, 3)), np.zeros((L, 3, 3))
    masses[which], centres[which, axis], inertias[which, axis, axis] = mass, centre, moment
    bodies = Bodies(masses, centres, inertias, np.zeros(L, np.int64)).within(chain.of_links)
    return reduced_parameters(chain, bodies, table.joint, table.coordinates)
