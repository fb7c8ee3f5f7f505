"""The models of a robot: what describes which of its joints, with units filled in."""

from pipeline.maths.models.independent import IndependentJoint
from pipeline.robots.robot import Joint

MODELS = ("independent",)


def independent(joint: Joint) -> IndependentJoint:
    """The model of a joint that is taken to move by itself.  Section 6.1"""
    return IndependentJoint(joint.name, joint.terms, tuple(joint.unit(term.unit) for term in joint.terms))
