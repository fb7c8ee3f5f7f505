"""The models of a robot's joints, with their units.

A variant is a structure, `independent` or `coupled`, plus an added friction, such as `coupled+dahl`.
"""

from collections.abc import Sequence
from typing import NamedTuple

from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.models.terms import (
    OF_MOTION,
    TERMS,
    Term,
    coulomb,
    presliding_friction,
    smooth_sign,
    stribeck,
    viscous,
)
from davinci_forces.robots.robot import Joint, Robot

STRUCTURES = ("independent", "coupled")
FRICTIONS = ("", "smooth", "stribeck", "dahl", "dahl2", "dahl3")
OPTIONAL_TERMS = ("offset", "stiffness", "gravity, sine", "gravity, cosine")  # that an independent joint may lack
VARIANTS = tuple(f"{model}+{friction}".removesuffix("+") for model in STRUCTURES for friction in FRICTIONS)
ARM = "arm"  # group of a model of the whole arm

WIDTH = 0.1  # width of a smooth sign, as a share of the root mean square velocity
FADED = 0.3  # decay velocity of Stribeck's peak, as the same kind of share
# Displacements of Dahl's states, as shares of the range of the motion; cross-validation chooses one set.  Real arms of
# two laboratories need 0.2 to 1 %.
DISPLACEMENTS = {
    "dahl": ((0.002,), (0.005,), (0.01,), (0.02,)),
    "dahl2": ((0.002, 0.02), (0.005, 0.02)),
    "dahl3": ((0.002, 0.005, 0.02),),
}


class Reach(NamedTuple):
    """Range of position, and root mean square velocity, of a joint; the scales of its friction are shares of these."""

    displacement: float
    velocity: float


class AddedFriction(NamedTuple):
    """Friction added to a structure: its variant, and its displacements as shares of the range of the motion."""

    variant: str
    shares: tuple[float, ...] = ()

    def terms(self, reach: Reach) -> tuple[Term, ...]:
        """The friction terms of a joint with this reach."""
        if self.variant == "smooth":
            return (smooth_sign(round_scale(WIDTH * reach.velocity)),)
        if self.variant == "stribeck":
            return (stribeck(round_scale(FADED * reach.velocity)),)
        scales = (round_scale(share * reach.displacement) for share in self.shares)
        return tuple(presliding_friction(scale, number) for number, scale in enumerate(scales, start=1))

    def __str__(self) -> str:
        percentages = ", ".join(f"{100 * share:g} %" for share in self.shares)
        return f"{self.variant} ({percentages})" if percentages else self.variant


def frictions() -> tuple[AddedFriction, ...]:
    """All frictions that cross-validation chooses from."""
    others = tuple(AddedFriction(variant) for variant in FRICTIONS if variant not in DISPLACEMENTS)
    return (*others, *(AddedFriction(variant, shares) for variant, sets in DISPLACEMENTS.items() for shares in sets))


def round_scale(scale: float) -> float:
    """Round a scale to three digits, more than its effect needs."""
    return float(f"{scale:.3g}")


def independent(joint: Joint, added: Sequence[Term] = (), name: str = "independent") -> IndependentJoint:
    """Model a joint independently of the others, with friction terms added to its own terms.  Section 6.1"""
    terms = (*joint.terms, *added)
    return IndependentJoint(joint.name, terms, tuple(joint.unit(term.unit) for term in terms), name)


def coupled_arm(
    robot: Robot, rows: Sequence[int], added: Sequence[Sequence[Term]], name: str = "coupled", group: str = ARM
) -> CoupledArm:
    """Model coupled joints `rows`, each with viscous, Coulomb and added friction; raises BadRobot without a chain."""
    names, joints = tuple(joint.name for joint in robot.joints), [robot.joints[row] for row in rows]
    friction = tuple((viscous, coulomb, *terms) for terms in added)
    keys = ("inertia", "effort", "position", "gain")
    units = tuple({key: joint.unit(f"{{{key}}}") for key in keys} for joint in joints)
    return CoupledArm(group, names, tuple(rows), robot.known_chain, friction, units, name)


def model_of(
    robot: Robot, structure: str, name: str, group: str, parameters: Sequence[str], scales: Sequence[float]
) -> Model:
    """Rebuild a model from its structure, name and group, and the names and scales of its parameters."""
    pairs = list(zip(parameters, scales, strict=True))
    if structure == "independent":
        joint = robot.joint(group)
        names = {term.name for term in joint.terms}
        added = [TERMS.get(name) or _added_term(name, scale) for name, scale in pairs if name not in names]
        return independent(joint, [term for term in added if term], name)
    names = {parameter for parameter, _ in pairs}
    moving = [i for i, joint in enumerate(robot.joints) if f"{viscous.name} of {joint.name}" in names]
    rows = moving if group == ARM else [[joint.name for joint in robot.joints].index(group)]
    by_row = []
    for row in rows:
        suffix = f" of {robot.joints[row].name}" if len(rows) > 1 else ""
        terms = [_added_term(x.removesuffix(suffix), scale) for x, scale in pairs if x.endswith(suffix)]
        by_row.append([term for term in terms if term])
    return coupled_arm(robot, rows, by_row, name, group)


def _added_term(name: str, scale: float) -> Term | None:
    """The added term with the name of a parameter and a scale; None for any other parameter."""
    if scale == 0.0:
        return OF_MOTION.get(name)
    by_name = {term.name: term for term in (smooth_sign(scale), stribeck(scale))}
    return by_name.get(name) or presliding_friction(scale, int(name.rpartition(" ")[2]))
