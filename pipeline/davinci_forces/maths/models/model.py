"""The interface of a model: the dynamics of a joint or of the whole arm, linear in the parameters.

    tau = Phi(q, dq, ddq) theta,        tau = M(q) ddq + b(q, dq) + tau_ext                            (6.8), (7.8)

Identification uses Phi and prediction uses Phi theta.  A filter tracks each joint alone and uses `JointDynamics`.
Shapes: N samples, n joints, m efforts, p parameters.

Parameters are combinations of masses, inertias and friction, none of which is negative:

    theta = A x,    J_l(x) >= 0 for every link l,    x_i >= 0 if physics determines the sign

A link is physically possible if its pseudo-inertia J_l is positive semidefinite: its mass density is then nowhere
negative, and the triangle inequalities hold.
Traversaro, Brossette, Escande and Nori, Identification of fully physical consistent inertial parameters using
optimization on manifolds, 2016.  Wensing, Kim and Slotine, 2018.  Of base parameters: Sousa and Cortesao, Physical
feasibility of robot base inertial parameter identification: a linear matrix inequality approach, 2014.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple, Protocol

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.terms import Coefficients


class Mechanism(NamedTuple):
    """The dependence theta = A x of p parameters on n numbers of links, then drives, cables and friction."""

    matrix: Array  # A (p, n)
    links: int  # L; the first 10 L of x are inertial parameters, in the order of `bodies.PARAMETERS`
    positive: Booleans  # (n,) numbers of x, other than inertial parameters, that are not negative


def of_signs(positive: Booleans) -> Mechanism:
    """A mechanism without links, theta = x; the parameters `positive` (p,) are not negative."""
    return Mechanism(np.eye(len(positive)), 0, positive)


class Parameter(NamedTuple):
    """One parameter of a model."""

    name: str
    typst: str  # its column of Phi, in Typst's maths
    unit: str
    positive: bool  # whether physics excludes negative values
    scale: float = 0.0  # displacement or velocity in its column, in the joint's units; 0 for none
    combination: str = ""  # of the parameters of links and drives that it is, if it is one


class ArmMotion(NamedTuple):
    """The motion of n joints on a uniform clock, in the joints' units."""

    q: Array  # (N, n)
    dq: Array  # (N, n)
    ddq: Array  # (N, n)
    T_s: float  # [s]
    segment: Integers  # (N,) a new number after each gap
    periodic: bool = False  # whether each segment is one period, which repeats
    memory: Mapping[tuple[int, float], tuple[Array, Booleans]] = {}  # deflections already computed: `friction_state`


class Regressor(NamedTuple):
    """Phi of a motion, and the samples at which it is known: after a gap, presliding friction is unknown at first."""

    Phi: Array  # (N, m, p)
    known: Booleans  # (N,)


class JointDynamics(NamedTuple):
    """Dynamics of one joint along a motion, for a filter: inertia ddq + b(c; q, dq) + known + tau_ext = tau."""

    inertia: Array  # (N,)
    coefficients: Coefficients  # c, of the bias as a function of the joint's q and dq
    known: Array  # (N,) effort known from the measured motion: coupling to other joints, presliding friction


class Model(Protocol):
    """A model of a joint or of the arm.  Every method is pure."""

    @property
    def name(self) -> str:
        """Its structure and friction, as in keys and in the setting `fit`, such as "independent"."""

    @property
    def group(self) -> str:
        """The name of the joint that it models, or "arm"."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Its joints, in the order of the axis n."""

    @property
    def efforts(self) -> tuple[str, ...]:
        """The joints whose effort it predicts, in the order of the axis m: all its joints, or some."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in the order of theta."""

    @property
    def displacements(self) -> Collection[tuple[int, float]]:
        """The index of the joint and the displacement, for every deflection in the model."""

    @property
    def mechanism(self) -> Mechanism:
        """The dependence of its parameters on physical numbers, and their constraints."""

    def regressor(self, motion: ArmMotion) -> Regressor:
        """Phi with tau = Phi theta.  (6.38)"""

    def joint_dynamics(self, theta: Array, motion: ArmMotion) -> tuple[JointDynamics, ...]:
        """The dynamics of each joint in `efforts`, for a filter.  (7.15), (7.16)"""
