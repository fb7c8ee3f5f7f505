"""Combine how the joints' errors go together in every log, for the force at the tip of all logs."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.maths.arrays import evenly
from davinci_forces.records import ArmCorrelation, JointCorrelation
from davinci_forces.robots.robot import Robot

LOGS = 20  # at most, that are kept


def run(correlations: Iterable[JointCorrelation], robot: Robot) -> Iterator[ArmCorrelation]:
    """One ArmCorrelation where any log tells of it."""
    own = list(correlations)
    if not own:
        return
    some = [own[i] for i in evenly(len(own), LOGS)]
    yield ArmCorrelation(
        robot=robot.name,
        source=np.array([one.log for one in some], object),
        rho_12=np.array([one.rho_12 for one in some]),
        rho_13=np.array([one.rho_13 for one in some]),
        rho_23=np.array([one.rho_23 for one in some]),
    )
