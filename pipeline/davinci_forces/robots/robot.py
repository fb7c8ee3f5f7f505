"""A robot as data: its joints, each with its motor, its model and its limits, and its kinematic chain."""

import math
import re
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple

from davinci_forces.errors import BadRobot
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.models.physical import PhysicalTable
from davinci_forces.maths.models.terms import Term

ANYWHERE = (-math.inf, math.inf)
MOST_JOINTS = 200  # moving ones: more would take minutes, by their square; a humanoid with both hands has 80
MOST_LINKS = 1000  # of a URDF, with frames that are fixed: sensors, tools, screws


class Kind(Enum):
    """The kind of a joint, which sets the units of its quantities."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"

    def unit(self, template: str, measured: str = "") -> str:
        """Fill in a unit of `quantities` or of a term: '{position}/s' is 'rad/s' for a revolute joint.

        Where effort is `measured` in A, parameters that multiply a motion are in A over the motion's unit.  Parameters
        of links then have the unknown factor of the effort.
        """
        position, effort, inertia = ("rad", "N m", "kg m^2") if self is Kind.REVOLUTE else ("m", "N", "kg")
        units = {"position": position, "effort": effort, "inertia": inertia, "mass_moment": "kg m", "gain": ""}
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
    effort: float = math.inf  # the largest that its drive gives at the joint, in either direction


UNLIMITED = Limits(ANYWHERE, ANYWHERE, ANYWHERE)


class PrintedColumn(NamedTuple):
    """A joint's parameters as a publication prints them for one estimator; "" for initial guesses."""

    estimator: str
    theta: tuple[float, ...]  # in the order of the joint's terms
    mse: float  # of the averaged effort


class Printed(NamedTuple):
    """The table of a publication that states a joint's parameters, and its misprints in words."""

    name: str
    columns: tuple[PrintedColumn, ...]
    misprints: tuple[str, ...]


@dataclass(frozen=True)
class Joint:
    """One joint: its motor (Table 6.3), the terms of its model (6.7-6.14), and how it is excited and filtered."""

    name: str
    title: str
    kind: Kind
    terms: tuple[Term, ...]
    limits: Limits
    gear_ratio: float = 1.0  # eta [-], or [rad/m] for a prismatic joint
    torque_constant: float = 1.0  # K_m [N m/A]
    effort: str = ""  # "A" where no torque constant is known, and effort is the motor's current; "" where it is
    harmonics: int = 2  # N_f of the excitation
    # Published excitation trajectories by name: period, a0, a1, b1, a2, b2, ...
    published: tuple[tuple[str, tuple[float, ...]], ...] = ()
    # Intensity of the external effort's random walk, a standard deviation per square root of a second
    # [effort/s^0.5]; 0 is the slowest that shows a push.  A choice, not a measurement; the report says so.
    q_tau: float = 0.0
    physical: PhysicalTable | None = None  # what the parameters of its terms are made of, where that is known
    printed: Printed | None = None  # parameters that were published for it

    def unit(self, template: str) -> str:
        """Fill in the joint's units."""
        return self.kind.unit(template, self.effort)


@dataclass(frozen=True)
class ControlStudy:
    """A controller to be tried in simulation: PD or PID with gravity compensation.  Chapter 5

    Every tuple has one number for each coordinate that takes part, in its own units; the others are held at 0.
    """

    name: str
    title: str
    start: tuple[float, ...]
    target: tuple[float, ...]
    proportional: tuple[float, ...]  # K_p
    derivative: tuple[float, ...]  # K_d
    integral: tuple[float, ...]  # K_i; 0 for PD
    viscous: tuple[float, ...]  # friction of the arm
    known_masses: float  # share of the masses that gravity compensation knows
    duration: float  # [s]


@dataclass(frozen=True)
class Tool:
    """The tool on a chain: the link at the far end of its shaft, which turns about it, and the shaft's length."""

    link: str
    length: float  # [m]


@dataclass(frozen=True)
class Robot:
    """The joints of an arm, from the base outwards; with its chain and bodies where its geometry is known.

    The first coordinates of the chain are the joints, in this order; `wrist` names those beyond them.
    """

    name: str
    title: str
    joints: tuple[Joint, ...] = field(default_factory=tuple)
    chain: Chain | None = None
    bodies: Bodies | None = None
    wrist: tuple[str, ...] = ()
    control: tuple[ControlStudy, ...] = ()
    tool: Tool | None = None  # where it is known which part of the chain it is, so that another may take its place
    file: str = field(default="", compare=False)  # that describes it, where a file does

    def with_tool(self, length: float) -> "Robot":
        """The robot with a tool whose shaft is this long [m].

        Raises
        ------
        BadRobot
            If it is not known which part of its chain the tool is.
        """
        if self.tool is None or self.chain is None:
            raise BadRobot(f"robot {self.name} has no known tool in its chain; leave the length of the tool out")
        chain = self.chain.lengthen(self.tool.link, length - self.tool.length)
        return replace(self, chain=chain, tool=replace(self.tool, length=length))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of all coordinates."""
        return (*(joint.name for joint in self.joints), *self.wrist)

    def joint(self, name: str) -> Joint:
        """The joint of that name.

        Raises
        ------
        BadRobot
            If there is none; the message lists those there are.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise BadRobot(f"robot {self.name} has no joint {name!r}; it has {', '.join(j.name for j in self.joints)}")
