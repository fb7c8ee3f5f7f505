"""Assess the external effort where nothing touches the robot: its level, and whether the filter's band covers it."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.maths.contact.detection import quiet
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty.free_space import levels
from davinci_forces.records import FreeSpace, Track
from davinci_forces.study import LogEntry

FORESEEN = 0.5  # [s] before a contact, in which the smoother sees it coming
FEWEST = 100  # samples of free space, below which nothing is said of its level


def run(track: Track, entry: LogEntry) -> Iterator[FreeSpace]:
    """The levels of one joint in one log; none of a joint at rest, or where it is not known when it was touched.

    At rest, friction takes any value up to its Coulomb level, so a small external effort says nothing.
    """
    free = free_space(track.t, entry.contact, track.rate)
    if track.at_rest or not entry.tells_free_space or int(free.sum()) < FEWEST:
        return
    calm = free_space(track.t, [(start - FORESEEN, end) for start, end in entry.contact], track.rate)
    smooth = quiet(track.tau_ext_smooth, calm if calm.any() else free, track.rate)
    space = levels(track.tau_ext[free], track.tau_ext_std[free])
    yield FreeSpace(
        log=track.log,
        joint=track.joint,
        filter=track.filter,
        role=track.role,
        tested=int(np.sum(free)),
        free_rms=space.rms,
        free_rms_std=space.rms_std,
        free_level=space.level_95,
        free_level_std=space.level_95_std,
        detection_level=space.level_99,
        detection_level_std=space.level_99_std,
        coverage=space.coverage,
        coverage_std=space.coverage_std,
        smooth_rms=smooth.rms,
        smooth_max=smooth.largest,
        crossings=smooth.crossings,
    )
