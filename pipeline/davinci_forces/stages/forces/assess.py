"""Assess the external effort where nothing touches the robot: its levels, and above which contacts stand out."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.maths.contact.detection import Quiet, alarm_level, quiet
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty.error_band import levels
from davinci_forces.records import FreeSpace, Threshold, Track
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


def gather(spaces: Iterable[FreeSpace]) -> Iterator[Threshold]:
    """One Threshold per joint and filter of which there is any free space: the highest level of any log."""
    every: dict[tuple[str, str], list[FreeSpace]] = {}
    for space in spaces:
        every.setdefault((space.joint, space.filter), []).append(space)
    for (joint, name), own in every.items():
        judging = [space for space in own if space.role != "identification"] or own  # that no parameter was fitted to
        judge = max(judging, key=lambda space: space.detection_level)
        alarms, loudest = max(((alarm(space), space) for space in judging), key=lambda pair: pair[0])
        yield Threshold(
            joint, name, judge.detection_level, judge.detection_level_std, alarms,
            alarms * loudest.free_rms_std / loudest.free_rms if loudest.free_rms else 0.0, judge.log,
        )  # fmt: skip


def alarm(space: FreeSpace) -> float:
    """The effort that this free motion crosses no more than once in ten minutes; it scales with the motion's size."""
    return alarm_level([Quiet(space.smooth_rms, space.smooth_max, space.crossings)])
