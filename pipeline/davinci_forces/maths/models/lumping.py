"""How physical parameters make those of a joint's model.

theta = C m(x),    m(x) monomials such as m_3, m_3 l_c3, m_3 l_c3^2             (6.7), (6.10), (6.13)
"""

from functools import cache

import numpy as np

from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.models import terms
from davinci_forces.maths.models.physical import Lumping, PhysicalTable, Quality
from davinci_forces.maths.models.reduced_joint import reduced_parameters

ROUNDING = 1e-12  # below which a parameter does not enter


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
