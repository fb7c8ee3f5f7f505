"""What is known of a joint's parameters before anything is measured."""

import numpy as np

from davinci_forces.estimators.problem import Known
from davinci_forces.maths.models.lumping import ROUNDING, lumping
from davinci_forces.maths.models.physical import Box
from davinci_forces.robots.robot import Joint


def known_of(joint: Joint) -> Known:
    """The signs that physics knows; where the robot has a table of it, what the parameters are made of, and a guess."""
    positive = np.array([term.positive for term in joint.terms])
    if joint.physical is None or joint.effort:  # a current does not say how much its motor pushes
        return Known(positive)
    made = lumping(joint.physical, joint.gear_ratio, tuple(term.name for term in joint.terms))
    if made is None:
        return Known(positive)
    guess, lower, upper = np.array([(x.guess, x.lower, x.upper) for x in joint.physical.parameters]).T
    theta = made.theta(guess)
    # What masses leave of each other by rounding is no guess; taken for one, it would be believed to all its digits.
    return Known(positive, Box(lower, upper, made), np.where(np.abs(theta) > ROUNDING, theta, 0.0))
