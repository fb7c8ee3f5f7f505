"""The model of a joint that moves alone, out of the chain: what (6.7), (6.10) and (6.13) write out by hand."""

import numpy as np

from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.drives import Drives
from davinci_forces.maths.mechanics.rigid_body import gravity, mass_matrix
from davinci_forces.maths.models import terms

REACH = np.linspace(-0.6, 0.6, 7)  # [rad] or [m]: three poses determine the coefficients, the rest confirm them
AGREEMENT = 1e-9


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
