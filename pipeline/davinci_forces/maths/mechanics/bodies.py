"""Masses and inertias of an arm's links, reflected inertia and friction of its drives, and its base parameters.

    eta tau_m = (eta^2 J_m + M) ddq + V + G + F + tau_ext,    F = v dq + c sign(dq)          (4.26), (4.28), (A.16)

Drives do not couple the coordinates.  Shapes: (n,) for a property, (..., n) for a motion.

The base parameters are the combinations of all inertial parameters that an arm's motion can identify:

    tau = Y(q, dq, ddq) pi,    Y P = Y_b [1 K],    beta = pi_b + K pi_d                                      (6.3)

P sorts the columns of Y into p base columns and those that depend on them.  Gautier, Numerical calculation of the base
inertial parameters of robots, 1991.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from davinci_forces.maths.arrays import Array

# The ten inertial parameters of a link, in the order of the regressor's columns: mass, first moments, and the inertia
# about the origin of the link's frame (not its centre of mass), in which the dynamics are linear.
PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_UPPER = np.triu_indices(3)
# Share of a column's size that must remain after its projection on the columns before: rounding leaves 1e-15 times the
# condition number of those, and an independent column of the arms here at least 1e-3.
NEGLIGIBLE_RESIDUAL = 1e-9
RANDOM_SAMPLES = 200  # random poses, velocities and accelerations, which show all base parameters of an arm


@dataclass(frozen=True, eq=False)
class Bodies:
    """The inertia of every link: masses (L,) [kg], centres (L, 3) [m] and inertias (L, 3, 3) [kg m^2].

    Centres are in the link's frame; inertias are about the centre of mass, in axes parallel to the link's frame (4.21).
    `counts_from` (L,) is the least number of coordinates with which a link is part of the model.  The arm with six
    coordinates has one jaw, and the second comes with the seventh (section 3.1.2).
    """

    masses: Array
    centres: Array
    inertias: Array
    counts_from: NDArray[np.int64]

    def with_coordinates(self, n: int) -> "Bodies":
        """The bodies of the model with n coordinates; others get mass 0."""
        there = self.counts_from <= n
        return replace(self, masses=self.masses * there, inertias=self.inertias * there[:, None, None])

    def with_density_factor(self, factor: float) -> "Bodies":
        """The same bodies with another density, as in a compensator with wrong masses.  Section 5.2"""
        return replace(self, masses=self.masses * factor, inertias=self.inertias * factor)

    def in_frames(self, T: Array) -> "Bodies":
        """The same bodies in other frames, relative to which their present frames are at T (L, 4, 4) [m]."""
        R = T[:, :3, :3]
        centres = np.einsum("lij,lj->li", R, self.centres) + T[:, :3, 3]
        return replace(self, centres=centres, inertias=R @ self.inertias @ R.swapaxes(1, 2))

    def about_frames(self) -> Array:
        """Inertias (L, 3, 3) about the origins of the links' frames [kg m^2], by the parallel axis theorem."""
        c = self.centres
        squares = np.einsum("li,li->l", c, c)[:, None, None] * np.eye(3) - np.einsum("li,lj->lij", c, c)
        return np.asarray(self.inertias + self.masses[:, None, None] * squares)

    def parameters(self, n: int) -> Array:
        """The inertial parameters (10 L,) of the model with n coordinates, ten a link in the order of PARAMETERS."""
        there = self.with_coordinates(n)
        inertia = there.about_frames()[:, *_UPPER]
        moments = there.masses[:, None] * there.centres
        return np.concatenate([there.masses[:, None], moments, inertia], axis=1).ravel()


def as_bodies(parameters: Array) -> Bodies:
    """The bodies with inertial parameters (L, 10), the inverse of `Bodies.parameters`; part of the model for any n.

    The centre of a body without mass is at the origin.
    """
    masses = parameters[:, 0]
    centres = np.divide(parameters[:, 1:4], masses[:, None], out=np.zeros((len(masses), 3)), where=masses[:, None] > 0)
    weightless = Bodies(masses, centres, np.zeros((len(masses), 3, 3)), np.zeros(len(masses), np.int64))
    inertias = np.zeros((len(masses), 3, 3))
    inertias[:, *_UPPER] = parameters[:, 4:]
    inertias = inertias + np.triu(inertias, 1).swapaxes(1, 2)
    return replace(weightless, inertias=inertias - weightless.about_frames())


def cylinder(mass: float, height: float, radius: float, axis: int) -> Array:
    """The inertia (3, 3) [kg m^2] of a uniform cylinder about its centre; `axis` 0, 1 or 2 is its own.  (4.23)"""
    across = mass * height**2 / 12.0 + mass * radius**2 / 4.0
    return np.diag([mass * radius**2 / 2.0 if i == axis else across for i in range(3)])


def pseudo_inertias(parameters: Array) -> Array:
    """[[S, h], [h', m]] (L, 4, 4) of inertial parameters (L, 10), S the second moments: I = tr(S) 1 - S.

    In another frame it is T J T'.  Wensing, Kim and Slotine, Linear matrix inequalities for physically consistent
    inertial parameter identification, 2018.
    """
    inertia = np.zeros((len(parameters), 3, 3))
    inertia[:, *_UPPER] = parameters[:, 4:]
    inertia = inertia + np.triu(inertia, 1).swapaxes(1, 2)
    J = np.zeros((len(parameters), 4, 4))
    J[:, :3, :3] = np.trace(inertia, axis1=1, axis2=2)[:, None, None] / 2.0 * np.eye(3) - inertia
    J[:, :3, 3] = J[:, 3, :3] = parameters[:, 1:4]
    J[:, 3, 3] = parameters[:, 0]
    return J


def of_pseudo_inertias(J: Array) -> Array:
    """The inertial parameters (L, 10) of pseudo-inertias (L, 4, 4): the inverse of `pseudo_inertias`."""
    S = J[:, :3, :3]
    inertia = np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) - S
    return np.concatenate([J[:, 3, 3:], J[:, :3, 3], inertia[:, *_UPPER]], axis=1)


@dataclass(frozen=True, eq=False)
class Drives:
    """One drive a coordinate (n,): all quantities at the joint, except the motor's own inertia.

    `viscous` and `coulomb` are those of joint and motor together, at the joint.  (A.11)
    """

    gear_ratio: Array  # eta [-], or [rad/m] for a prismatic joint
    motor_inertia: Array  # J_m [kg m^2]
    viscous: Array  # v [N m s/rad], or [N s/m]
    coulomb: Array  # c [N m], or [N]

    @property
    def inertia(self) -> Array:
        """The motors' inertia at the joints, eta^2 J_m (n,).  (4.28), which (4.29) neglects and (6.7)-(6.13) keep"""
        return np.asarray(self.gear_ratio**2 * self.motor_inertia)

    def friction(self, dq: ArrayLike) -> Array:
        """F (..., n) at the velocities dq (..., n).  (4.26)"""
        dq = np.asarray(dq, float)
        return np.asarray(self.viscous * dq + self.coulomb * np.sign(dq))


class BaseParameters(NamedTuple):
    """The identifiable inertial parameters: beta = K pi, p combinations of the 10 L."""

    columns: NDArray[np.int64]  # (p,) of Y, which span all the others: tau = Y[:, columns] beta
    combination: Array  # K (p, 10 L): how all parameters enter each
    condition: float  # of the base columns, each scaled to unit length


def base_parameters(Y: Array) -> BaseParameters:
    """Reduce the regressor (..., 10 L) of a motion to independent columns.

    Columns are chosen in the order of Y, from the base outwards, if they do not depend on those before.  So they are
    the same for any motion, as in the grouping by hand (Khalil and Kleinfinger 1987).  The motion must be rich, such as
    random poses, velocities and accelerations: parameters that it does not show are left out.
    """
    from scipy.linalg import qr, solve_triangular  # which every command would load

    (R,) = qr(Y.reshape(-1, Y.shape[-1]), mode="r")  # it has the dependences of Y's columns, in as many rows
    scale = np.linalg.norm(R, axis=0)
    shown = np.flatnonzero(scale > NEGLIGIBLE_RESIDUAL * scale.max())
    unit = R[:, shown] / scale[shown]
    Q = np.empty((len(unit), 0))
    taken = list[int]()
    for column, x in enumerate(unit.T):
        residual = x - Q @ (Q.T @ x)
        residual -= Q @ (Q.T @ residual)  # once more, against the rounding of the first
        if (size := np.linalg.norm(residual)) > NEGLIGIBLE_RESIDUAL:
            Q = np.column_stack([Q, residual / size])
            taken.append(column)
    triangle = np.triu(Q.T @ unit[:, taken])
    K = np.zeros((len(taken), len(scale)))
    K[:, shown] = solve_triangular(triangle, Q.T @ unit) * scale[shown] / scale[shown[taken]][:, None]
    K[:, shown[taken]] = np.eye(len(taken))
    return BaseParameters(shown[taken], K, float(np.linalg.cond(triangle)))
