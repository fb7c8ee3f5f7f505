"""What the parameters of a model are made of, and what of it no mechanism has: negative mass, inertia, friction.

    theta = A x,    J_l(x) >= 0 of every link,    x_i >= 0 where physics knows it

x are the inertial parameters of links, ten each, and whatever else a model has.  A link can exist where its
pseudo-inertia J_l is positive semidefinite: its mass is then spread over space and nowhere negative, and triangle
inequalities hold.  Traversaro, Brossette, Escande and Nori, Identification of fully physical consistent inertial
parameters using optimization on manifolds, 2016; Wensing, Kim and Slotine, 2018; of base parameters Sousa and Cortesao,
Physical feasibility of robot base inertial parameter identification: a linear matrix inequality approach, 2014.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans


class Mechanism(NamedTuple):
    """What p parameters are made of: n numbers of links, drives, cables and friction."""

    matrix: Array  # A (p, n)
    links: int  # L, of which the first 10 L of x are the inertial parameters, in the order of `bodies.PARAMETERS`
    positive: Booleans  # (n,) what else is not negative

    @property
    def has_bodies(self) -> bool:
        """Whether there is more to know of it than the signs of its parameters."""
        return self.links > 0


def of_signs(positive: Booleans) -> Mechanism:
    """Parameters that are made of nothing but themselves, some of which (p,) are not negative."""
    return Mechanism(np.eye(len(positive)), 0, positive)
