"""The model of a joint that moves independently of the others: a sum of terms.  Section 6.1"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.memory import efforts, friction_state
from davinci_forces.maths.models.model import ArmMotion, JointDynamics, Mechanism, Parameter, Regressor, of_signs
from davinci_forces.maths.models.terms import COULOMB, Coefficients, Term, bias

# The functions `COEFFICIENTS`, of q, dq and z.
FUNCTIONS: dict[str, Callable[[Array, Array, Array | float], Array | float]] = {
    "1": lambda q, dq, z: 1.0,
    "sin q": lambda q, dq, z: np.sin(q),
    "cos q": lambda q, dq, z: np.cos(q),
    "q": lambda q, dq, z: q,
    "dq": lambda q, dq, z: dq,
    "sign(dq)": lambda q, dq, z: np.sign(dq),
    "z": lambda q, dq, z: z,
}


@dataclass(frozen=True)
class IndependentJoint:
    """tau = sum_i theta_i (a_i ddq + b_i(q, dq)), with the unit of each parameter.  (6.8), (6.11), (6.13)"""

    group: str
    terms: tuple[Term, ...]
    units: tuple[str, ...]  # of the parameters
    name: str = "independent"

    @property
    def joints(self) -> tuple[str, ...]:
        """The one joint of the model."""
        return (self.group,)

    efforts = joints

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """One parameter for each term."""
        pairs = zip(self.terms, self.units, strict=True)
        return tuple(Parameter(term.name, term.typst, unit, term.positive, term.scale) for term, unit in pairs)

    @property
    def displacements(self) -> set[tuple[int, float]]:
        """The index 0 of the joint and the displacement, for each term of presliding friction."""
        return {(0, term.displacement) for term in self.terms if term.displacement}

    @property
    def mechanism(self) -> Mechanism:
        """The parameters themselves: the model has no links, so that only signs are constrained."""
        return of_signs(np.array([term.positive for term in self.terms]))

    def regressor(self, motion: ArmMotion) -> Regressor:
        """Phi (N, 1, p).  (6.9), (6.12), (6.14)"""
        q, dq, ddq = (x[:, 0] for x in motion[:3])
        valid, Phi = np.ones(len(q), np.bool_), np.zeros((len(q), 1, len(self.terms)))
        for i, term in enumerate(self.terms):
            z, z_valid = friction_state(motion, 0, term)
            valid &= z_valid
            add(term, q, dq, ddq, z, Phi[:, 0, i])
        return Regressor(Phi, valid)

    def sensitivity(self, motion: ArmMotion) -> Array:
        """Derivatives (N, 3, p) of the regressor by q, dq and ddq, 0 for sign(dq) and for states z of friction."""
        c = np.array([term.coefficients for term in self.terms]).T
        _, by_q, by_dq = bias(tuple(c), motion.q, motion.dq, 0.0)
        return np.stack(np.broadcast_arrays(by_q, by_dq, [term.a for term in self.terms]), axis=1)

    def inertia_columns(self, q: Array) -> Array:
        """Derivatives (N, 1, 1, p) of M at q (N, 1) by the parameters."""
        return np.tile(np.array([term.a for term in self.terms]), (len(q), 1, 1, 1))

    def joint_dynamics(self, theta: Array, motion: ArmMotion) -> tuple[JointDynamics]:
        """Functions of q, dq and ddq as inertia and coefficients; states z of friction as known effort."""
        c = bias_coefficients(self.terms, theta)
        of_z = theta * np.array([term.has_z for term in self.terms])
        known_effort = np.zeros(len(motion.q))
        if of_z.any():
            known_effort = efforts(self, of_z, motion)[:, 0]
            known_effort -= bias_coefficients(self.terms, of_z)[COULOMB] * np.sign(motion.dq[:, 0])
        return (JointDynamics(np.broadcast_to(inertia_of(self.terms, theta), len(motion.q)), c, known_effort),)


def regressor(terms: Sequence[Term], q: Array, dq: Array, ddq: Array) -> Array:
    """Phi (..., K, p) of terms without z; q, dq and ddq (..., K) in the joint's units.  (6.9), (6.12), (6.14)"""
    Phi = np.zeros((len(terms), *q.shape))
    for phi, term in zip(Phi, terms, strict=True):
        add(term, q, dq, ddq, 0.0, phi)
    return np.moveaxis(Phi, 0, -1)


def add(term: Term, q: Array, dq: Array, ddq: Array, z: Array | float, phi: Array) -> None:
    """Add a ddq + b(q, dq, z) of one term to `phi` (...); unlike `bias`, only the term's functions are computed."""
    if term.a:
        phi += term.a * ddq
    for name, coefficient in term.b.items():
        phi += coefficient * FUNCTIONS[name](q, dq, z)


def inertia_of(terms: Sequence[Term], theta: Array) -> float:
    """The inertia M, the factor of ddq, which is constant for an independent joint.  (6.5)"""
    return float(sum(p * term.a for p, term in zip(theta, terms, strict=True)))


def bias_coefficients(terms: Sequence[Term], theta: Array) -> Coefficients:
    """Coefficients of b = sum_i theta_i b_i, for `bias`, without z."""
    return (*(np.asarray(theta) @ [term.coefficients for term in terms]).tolist()[:-1], 0.0)
