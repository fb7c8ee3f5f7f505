"""A robot as data: its kinematic chain and its joints, each with a motor, a model and limits."""

import math
import re
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from typing import NamedTuple

from numpy.typing import ArrayLike

from davinci_forces.errors import BadRobot
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.placed import transform
from davinci_forces.maths.models.physical import Lumping, PhysicalTable, physical_lumping
from davinci_forces.maths.models.terms import Term, gravity_cos, gravity_sin, inertia, lifted_mass, offset

ANYWHERE = (-math.inf, math.inf)
MOST_JOINTS = 200  # moving joints; the time grows with their square, to minutes; a humanoid with two hands has 80
MOST_LINKS = 1000  # of a URDF, including fixed frames: sensors, tools, screws
TIP_JOINTS = 3  # number of joints that carry the tip; the wrist is assumed to be straight


class Kind(Enum):
    """The kind of a joint, which sets the units of its quantities."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"

    @cache
    def unit(self, template: str, measured: str = "", is_geared: bool = True) -> str:
        """Fill in a unit of `quantities` or of a term: '{position}/s' is 'rad/s' for a revolute joint.

        If effort is `measured` in A, a parameter that multiplies a motion is in A over the unit of that motion.  Link
        parameters then contain the unknown factor between A and the effort's unit.  Unless the joint `is_geared`, its
        torque constant is the effort of the joint per A.
        """
        position, effort, inertia = ("rad", "N m", "kg m^2") if self is Kind.REVOLUTE else ("m", "N", "kg")
        units = {"position": position, "effort": effort, "inertia": inertia, "mass_moment": "kg m", "gain": ""}
        units["torque_constant"] = "N m/A" if is_geared else f"{effort}/A"
        if measured:
            units |= {"effort": measured, "inertia": f"{measured} s^2/{position}", "mass_moment": f"{measured} s^2/m"}
            units["gain"] = f" {measured}/({effort})"
        filled = template.format(**units)
        return re.sub(r"\((\w+)\)\^", r"\1^", filled)  # (N)^2 is N^2, but (N m)^2 is not N m^2


@dataclass(frozen=True)
class Limits:
    """Lower and upper bounds of position, velocity and acceleration, in the joint's units.  Table 6.2"""

    q: tuple[float, float]
    dq: tuple[float, float]
    ddq: tuple[float, float]
    effort: float = math.inf  # largest effort of the drive at the joint, in either direction

    @property
    def motion(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """Bounds of position, velocity and acceleration."""
        return self.q, self.dq, self.ddq


UNLIMITED = Limits(ANYWHERE, ANYWHERE, ANYWHERE)


class PrintedColumn(NamedTuple):
    """The parameters of a joint that a publication prints for one estimator; "" for initial guesses."""

    estimator: str
    theta: tuple[float, ...]  # in the order of the joint's terms
    mse: float  # mean squared error of the averaged effort


@dataclass(frozen=True)
class Joint:
    """One joint: motor (Table 6.3), terms of its model (6.7-6.14), limits, and settings of excitation and filter."""

    name: str
    title: str
    kind: Kind
    terms: tuple[Term, ...]
    limits: Limits
    gear_ratio: float = 1.0  # eta [-], or [rad/m] for a prismatic joint
    torque_constant: float = 1.0  # K_m [N m/A], or [N/A] of a prismatic joint without a gear
    effort: str = ""  # "A" if the torque constant is unknown, so that effort is the motor current; else ""
    harmonics: int = 2  # N_f of the excitation
    # Published excitation trajectories by name: period, a0, a1, b1, a2, b2, ...
    published: tuple[tuple[str, tuple[float, ...]], ...] = ()
    # Intensity of the random walk of the external effort: a standard deviation per square root of time [effort/s^0.5];
    # 0 selects the slowest walk that shows a push.  It is a choice, not a measurement, as the report states.
    q_tau: float = 0.0
    physical: PhysicalTable | None = None  # physical parameters behind its terms, if known
    printed: tuple[PrintedColumn, ...] = ()  # published parameters of its terms

    @property
    def for_units(self) -> tuple[Kind, str, bool]:
        """What its units depend on: its kind, the unit of a measured effort, and whether it is geared."""
        return self.kind, self.effort, self.gear_ratio != 1.0

    def unit(self, template: str) -> str:
        """Fill in the joint's units."""
        return self.kind.unit(template, *self.for_units[1:])

    @property
    def effort_per_ampere(self) -> float:
        """The effort of the joint [N m/A, or N/A] by the current of its motor."""
        return self.gear_ratio * self.torque_constant

    @property
    def dependence(self) -> Lumping | None:
        """The dependence of its parameters on physical ones; None if these are unknown or make other parameters up."""
        names = tuple(term.name for term in self.terms)
        return physical_lumping(self.physical, self.gear_ratio, names) if self.physical else None

    def terms_under_gravity(self, loaded: bool) -> tuple[Term, ...]:
        """The terms of its model if gravity loads the joint, or does not; a prismatic joint feels a constant force."""
        weight = (gravity_sin, gravity_cos) if self.kind is Kind.REVOLUTE else (offset,)
        kept = [term for term in self.terms if term not in (inertia, lifted_mass, gravity_sin, gravity_cos, *weight)]
        return (inertia, *(weight if loaded else ()), *kept)


@dataclass(frozen=True)
class ControlStudy:
    """A simulated controller: PD or PID with gravity compensation.  Chapter 5

    Every tuple has one number for each controlled coordinate, in the coordinate's units; other coordinates stay at 0.
    """

    name: str
    title: str
    start: tuple[float, ...]
    target: tuple[float, ...]
    proportional: tuple[float, ...]  # K_p
    derivative: tuple[float, ...]  # K_d
    integral: tuple[float, ...]  # K_i; 0 for PD
    viscous: tuple[float, ...]  # friction of the arm
    known_masses: float  # share of the masses in the gravity compensation
    duration: float  # [s]


@dataclass(frozen=True)
class Tool:
    """The tool of a chain: the link that turns about the shaft, at its far end, and the length of the shaft."""

    link: str
    length: float  # [m]


@dataclass(frozen=True)
class Robot:
    """The joints of an arm, from the base outwards, and its chain and bodies if they are known.

    The first coordinates of the chain are the joints, in this order; `wrist` names the other coordinates.
    """

    name: str
    title: str
    joints: tuple[Joint, ...] = field(default_factory=tuple)
    chain: Chain | None = None
    bodies: Bodies | None = None
    wrist: tuple[str, ...] = ()
    control: tuple[ControlStudy, ...] = ()
    tool: Tool | None = None  # None if the tool's part of the chain is unknown, so that the tool cannot be replaced
    file: str = field(default="", compare=False)  # file that describes the robot, or ""

    def with_tool(self, length: float) -> "Robot":
        """The robot with a tool whose shaft has this length [m]; raises BadRobot if its present tool is unknown."""
        if self.tool is None or self.chain is None:
            raise BadRobot(f"robot {self.name} has no known tool in its chain; leave the length of the tool out")
        chain = self.chain.lengthen(self.tool.link, length - self.tool.length)
        return replace(self, chain=chain, tool=replace(self.tool, length=length))

    def with_base(self, rpy: tuple[float, float, float]) -> "Robot":
        """The robot on a base with this roll, pitch and yaw [rad] in a world whose z axis points up.

        Positions, forces and the tip stay in base axes.  Each joint's model gets the gravity terms of this base, and
        loses its published parameters, which are of an upright base.

        Raises BadRobot if the robot has no chain, which tells how gravity loads its joints.
        """
        if self.chain is None:
            raise BadRobot(f"robot {self.name} has no chain, so gravity on another base is not known; leave base out")
        x, y, z = transform((0.0, 0.0, 0.0), rpy)[2, :3].tolist()  # the world's z in base axes
        chain = replace(self.chain, up=(x, y, z))
        if math.isclose(z, 1.0, rel_tol=0, abs_tol=1e-12):
            return self
        joints = zip(self.joints, rigid_body.loaded_by_gravity(chain)[: len(self.joints)], strict=True)
        turned = (replace(j, terms=j.terms_under_gravity(loaded), physical=None, printed=()) for j, loaded in joints)
        return replace(self, chain=chain, joints=tuple(turned))

    def tip(self, q: ArrayLike) -> Array:
        """Position of the tip (..., 3) [m] in base axes."""
        return kinematics.tip(self.known_chain, q)

    def jacobian(self, q: ArrayLike) -> tuple[Array, Array]:
        """J_v and J_omega (..., 3, n) of the tip in base axes.  (7.21)-(7.24)"""
        return kinematics.jacobian(self.known_chain, q)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M (..., n, n) of the links.  (4.38)"""
        return rigid_body.mass_matrix(self.known_chain, self.known_bodies, q)

    def coriolis_matrix(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """C (..., n, n) of the Christoffel symbols, for which dM/dt - 2 C is skew-symmetric.  (5.6), (5.12)"""
        return rigid_body.coriolis_matrix(self.known_chain, self.known_bodies, q, dq)

    def gravity(self, q: ArrayLike) -> Array:
        """G (..., n): the effort that holds the arm still.  (4.38)"""
        return rigid_body.gravity(self.known_chain, self.known_bodies, q)

    def inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """The effort tau (..., n) of the links in this motion, without friction and contact.  (4.38)"""
        return rigid_body.inverse_dynamics(self.known_chain, self.known_bodies, q, dq, ddq)

    def forward_dynamics(self, q: ArrayLike, dq: ArrayLike, tau: ArrayLike) -> Array:
        """The acceleration ddq (..., n) of the links under efforts tau, without friction and contact.  (4.41)"""
        return rigid_body.forward_dynamics(self.known_chain, self.known_bodies, q, dq, tau)

    def energy(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array]:
        """Kinetic and potential energy (...,) [J]; the potential energy is 0 at the base's origin.  (4.12)-(4.15)"""
        return rigid_body.energy(self.known_chain, self.known_bodies, q, dq)

    @property
    def known_chain(self) -> Chain:
        """The chain; raises BadRobot if the robot's geometry is not known."""
        if self.chain is None:
            raise BadRobot(f"robot {self.name} has no chain: its geometry is not known; use a URDF, or add [[link]]")
        return self.chain

    @property
    def known_bodies(self) -> Bodies:
        """The bodies; raises BadRobot if the masses of the robot's links are not known."""
        if self.bodies is None:
            raise BadRobot(f"robot {self.name} has no bodies: the masses of its links are not known")
        return self.bodies

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of all coordinates."""
        return (*(joint.name for joint in self.joints), *self.wrist)

    def joint(self, name: str) -> Joint:
        """The joint with this name; raises BadRobot, with the names of all joints, if there is none."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise BadRobot(f"robot {self.name} has no joint {name!r}; it has {', '.join(j.name for j in self.joints)}")
