"""What a model is: the dynamics of a joint or of the whole arm, linear in its parameters.

    tau = Phi(q, dq, ddq) theta,        tau = M(q) ddq + b(q, dq) + tau_ext                            (6.8), (7.8)

Identification uses Phi, prediction Phi theta, and a filter, which tracks each joint by itself, `JointDynamics`.
Shapes: N samples, n joints, m efforts, p parameters.

Parameters are combinations of masses, inertias and friction, none of which is negative:

    theta = A x,    J_l(x) >= 0 of every link,    x_i >= 0 where physics knows the sign

x are the inertial parameters of links, ten each, and all others of a model.  A link is possible if its pseudo-inertia
J_l is positive semidefinite: then its mass density is nowhere negative, and the triangle inequalities hold.
Traversaro, Brossette, Escande and Nori, Identification of fully physical consistent inertial parameters using
optimization on manifolds, 2016.  Wensing, Kim and Slotine, 2018.  Of base parameters: Sousa and Cortesao, Physical
feasibility of robot base inertial parameter identification: a linear matrix inequality approach, 2014.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple, Protocol

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.bias import Coefficients


class Mechanism(NamedTuple):
    """How p parameters depend on n numbers of links, drives, cables and friction."""

    matrix: Array  # A (p, n)
    links: int  # L, of which the first 10 L of x are the inertial parameters, in the order of `bodies.PARAMETERS`
    positive: Booleans  # (n,) the other numbers that are not negative

    @property
    def has_bodies(self) -> bool:
        """Whether links constrain the parameters, besides signs."""
        return self.links > 0


def of_signs(positive: Booleans) -> Mechanism:
    """A mechanism without links: parameters of their own, some of which (p,) are not negative."""
    return Mechanism(np.eye(len(positive)), 0, positive)


class Parameter(NamedTuple):
    """One parameter of a model."""

    name: str
    typst: str  # its column, in Typst's maths
    unit: str
    positive: bool  # whether physics knows its sign
    scale: float = 0.0  # the displacement or velocity that its column depends on, in the joint's units; 0 for none


class ArmMotion(NamedTuple):
    """The motion of n joints on a uniform clock, in the joints' units."""

    q: Array  # (N, n)
    dq: Array  # (N, n)
    ddq: Array  # (N, n)
    T_s: float  # [s]
    segment: Integers  # (N,) a new number after each gap
    periodic: bool = False  # whether each segment is one period, which repeats
    memory: Mapping[tuple[int, float], tuple[Array, Booleans]] = {}  # deflections computed before: `friction_state`


class Regressor(NamedTuple):
    """Phi of a motion, and the samples at which it is known: memory starts unknown after each gap."""

    Phi: Array  # (N, m, p)
    known: Booleans  # (N,)


class JointDynamics(NamedTuple):
    """Dynamics of one joint along a motion, for a filter: inertia ddq + b(c; q, dq) + known + tau_ext = tau."""

    inertia: Array  # (N,)
    coefficients: Coefficients  # c, of what depends on the joint's own state
    known: Array  # (N,) effort that the measured motion determines: of other joints, of friction's memory


class Model(Protocol):
    """A model of a joint or of the arm.  Every method is pure."""

    @property
    def name(self) -> str:
        """Its structure, as keys and the setting `fit` name it: "independent"."""
        ...

    @property
    def group(self) -> str:
        """Its subject: a joint by name, or "arm"."""
        ...

    @property
    def joints(self) -> tuple[str, ...]:
        """Its joints, in the order of the axis n."""
        ...

    @property
    def efforts(self) -> tuple[str, ...]:
        """The joints whose effort it gives, in the order of the axis m: its joints, or some of them."""
        ...

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in the order of theta."""
        ...

    @property
    def displacements(self) -> Collection[tuple[int, float]]:
        """Joint and displacement of every deflection in the model."""
        ...

    @property
    def mechanism(self) -> Mechanism:
        """The physical numbers behind its parameters, and their constraints."""
        ...

    def regressor(self, motion: ArmMotion) -> Regressor:
        """Phi with tau = Phi theta.  (6.38)"""
        ...

    def inertia(self, theta: Array, q: Array) -> Array:
        """M (N, m, m) at q (N, n), of the joints whose effort it gives.  (6.5)"""
        ...

    def bias(self, theta: Array, motion: ArmMotion) -> Array:
        """The effort (N, m) of this motion at zero acceleration.  (4.38)"""
        ...

    def joint_dynamics(self, theta: Array, motion: ArmMotion) -> tuple[JointDynamics, ...]:
        """Dynamics for a filter of each joint whose effort it gives.  (7.15), (7.16)"""
        ...
