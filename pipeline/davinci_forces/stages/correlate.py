"""Correlate the errors of the joints that carry the tip, in each log where all of them move and nothing is touched."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.maths.signals.windows import SETTLE, free_space
from davinci_forces.records import JointCorrelation, Track
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

FEWEST = 100  # samples of free space, below which nothing is said
ARM = 3  # joints that carry the tip


def run(tracks: Sequence[Track], entry: LogEntry, robot: Robot) -> Iterator[JointCorrelation]:
    """One JointCorrelation of a log; none where a joint is at rest, or where it is not known when it was touched."""
    own = [track for joint in robot.joints[:ARM] for track in tracks if track.joint == joint.name and not track.at_rest]
    if robot.chain is None or len(robot.joints) != ARM or len(own) < ARM or not entry.tells_free_space:
        return
    calm = [(start - SETTLE, end) for start, end in entry.contact]  # the smoother sees a contact coming
    free = free_space(own[0].t, calm, own[0].rate)
    errors = np.array([track.tau_ext_smooth[free] for track in own])
    if errors.shape[1] < FEWEST or not errors.std(1).all():
        return
    rho = np.corrcoef(errors)
    yield JointCorrelation(entry.name, errors.shape[1], float(rho[0, 1]), float(rho[0, 2]), float(rho[1, 2]))
