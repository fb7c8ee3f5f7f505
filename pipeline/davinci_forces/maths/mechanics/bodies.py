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

# The ten inertial parameters of a link, in the order of the regressor's columns: mass, first moments and inertia.  The
# inertia is about the origin of the link's frame, not its centre of mass, because then the dynamics are linear.
PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_UPPER = np.triu_indices(3)
# A column depends on the earlier columns if its residual is at most this share of its length.  Rounding leaves 1e-15
# times their condition number.  Independent columns of the arms here leave at least 1e-3.
NEGLIGIBLE_RESIDUAL = 1e-9
RANDOM_SAMPLES = 200  # random poses, velocities and accelerations; enough to identify all base parameters of an arm


@dataclass(frozen=True, eq=False)
class Bodies:
    """The inertia of every link: masses (L,) [kg], centres (L, 3) [m] and inertias (L, 3, 3) [kg m^2].

    Centres are in the link's frame; inertias are about the centre of mass, in axes parallel to the link's frame (4.21).
    A link is part of the model if the model has at least `counts_from` (L,) coordinates.  With six coordinates the arm
    has one jaw, and the seventh adds the second jaw (section 3.1.2).
    """

    masses: Array
    centres: Array
    inertias: Array
    counts_from: NDArray[np.int64]

    def with_coordinates(self, n: int) -> "Bodies":
        """The bodies of the model with n coordinates; links outside the model get mass 0."""
        included = self.counts_from <= n
        return replace(self, masses=self.masses * included, inertias=self.inertias * included[:, None, None])

    def with_density_factor(self, factor: float) -> "Bodies":
        """The same bodies with scaled density, as in a gravity compensator with wrong masses.  Section 5.2"""
        return replace(self, masses=self.masses * factor, inertias=self.inertias * factor)

    def in_frames(self, T: Array) -> "Bodies":
        """The same bodies in other frames; T (L, 4, 4) [m] are the poses of the present frames in the new ones."""
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
        bodies = self.with_coordinates(n)
        inertia = bodies.about_frames()[:, *_UPPER]
        moments = bodies.masses[:, None] * bodies.centres
        return np.concatenate([bodies.masses[:, None], moments, inertia], axis=1).ravel()


def as_bodies(parameters: Array) -> Bodies:
    """The bodies with inertial parameters (L, 10), for any n: the inverse of `Bodies.parameters`."""
    masses = parameters[:, 0]
    centres = np.divide(parameters[:, 1:4], masses[:, None], out=np.zeros((len(masses), 3)), where=masses[:, None] > 0)
    weightless = Bodies(masses, centres, np.zeros((len(masses), 3, 3)), np.zeros(len(masses), np.int64))
    return replace(weightless, inertias=tensors(parameters) - weightless.about_frames())


def tensors(parameters: Array) -> Array:
    """The inertias (L, 3, 3) about the origins of the frames among inertial parameters (L, 10)."""
    inertias = np.zeros((len(parameters), 3, 3))
    inertias[:, *_UPPER] = parameters[:, 4:]
    return np.asarray(inertias + np.triu(inertias, 1).swapaxes(1, 2))


def cylinder(mass: float, height: float, radius: float, axis: int) -> Array:
    """The inertia (3, 3) [kg m^2] of a uniform cylinder about its centre; `axis` is 0, 1 or 2.  (4.23)"""
    across = mass * height**2 / 12.0 + mass * radius**2 / 4.0
    return np.diag([mass * radius**2 / 2.0 if i == axis else across for i in range(3)])


def pseudo_inertias(parameters: Array) -> Array:
    """J = [[S, h], [h', m]] (L, 4, 4) of inertial parameters (L, 10), with second moments S: I = tr(S) 1 - S.

    In a frame in which this frame has the pose T, it is T J T'.  Wensing, Kim and Slotine, Linear matrix inequalities
    for physically consistent inertial parameter identification, 2018.
    """
    inertia, J = tensors(parameters), np.zeros((len(parameters), 4, 4))
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
    """The drive of each coordinate (n,): all quantities are at the joint, except the inertia of the motor."""

    gear_ratio: Array  # eta [-], or [rad/m] for a prismatic joint
    motor_inertia: Array  # J_m [kg m^2]
    viscous: Array  # v [N m s/rad], or [N s/m], of joint and motor together.  (A.11)
    coulomb: Array  # c [N m], or [N], likewise

    @property
    def inertia(self) -> Array:
        """The motors' inertia at the joints, eta^2 J_m (n,).  (4.28); neglected in (4.29), kept in (6.7)-(6.13)"""
        return np.asarray(self.gear_ratio**2 * self.motor_inertia)

    def friction(self, dq: ArrayLike) -> Array:
        """F (..., n) at the velocities dq (..., n).  (4.26)"""
        dq = np.asarray(dq, float)
        return np.asarray(self.viscous * dq + self.coulomb * np.sign(dq))


class BaseParameters(NamedTuple):
    """The identifiable inertial parameters: beta = K pi, p combinations of the 10 L."""

    columns: NDArray[np.int64]  # (p,) columns of Y that span all columns: tau = Y[:, columns] beta
    combination: Array  # K (p, 10 L): beta = K pi
    condition: float  # condition number of the base columns, scaled to unit length


def base_parameters(Y: Array) -> BaseParameters:
    """Reduce the regressor (..., 10 L) of a motion to independent columns.

    A column is chosen if it does not depend on the columns before it, in the order of Y, from the base outwards.  The
    choice is therefore the same for any rich motion, as in the grouping by hand (Khalil and Kleinfinger 1987).  The
    motion must be rich, such as random poses, velocities and accelerations: a poor motion omits parameters.
    """
    from scipy.linalg import qr, solve_triangular  # here, so that not every command loads it

    (R,) = qr(Y.reshape(-1, Y.shape[-1]), mode="r")  # R has few rows, and its columns depend on each other like Y's
    scale = np.linalg.norm(R, axis=0)
    excited = np.flatnonzero(scale > NEGLIGIBLE_RESIDUAL * scale.max())
    unit = R[:, excited] / scale[excited]
    Q = np.empty((len(unit), 0))
    chosen = list[int]()
    for column, x in enumerate(unit.T):
        residual = x - Q @ (Q.T @ x)
        residual -= Q @ (Q.T @ residual)  # again, to remove the rounding of the first projection
        if (length := np.linalg.norm(residual)) > NEGLIGIBLE_RESIDUAL:
            Q = np.column_stack([Q, residual / length])
            chosen.append(column)
    triangle = np.triu(Q.T @ unit[:, chosen])
    columns = excited[chosen]
    K = np.zeros((len(columns), len(scale)))
    K[:, excited] = solve_triangular(triangle, Q.T @ unit) * scale[excited] / scale[columns][:, None]
    K[:, columns] = np.eye(len(columns))
    return BaseParameters(columns, K, float(np.linalg.cond(triangle)))
