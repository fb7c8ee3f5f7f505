"""Compute the level that external efforts in free space stay below, and the alarm level that detects a contact."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.maths.contact.detection import FreeMotionStatistics, alarm_level, free_motion_statistics
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty.error_band import levels
from davinci_forces.records import FreeSpace, Threshold, Track
from davinci_forces.study import LogEntry

MARGIN_BEFORE_CONTACT = 0.5  # [s] before a contact in which the smoother already responds to the contact
MIN_SAMPLES_LEVEL = 100  # of free space


def run(track: Track, entry: LogEntry) -> Iterator[FreeSpace]:
    """Compute the levels of one moving joint in one log in which the times of contact are known.

    Joints at rest are left out: friction takes any value up to its Coulomb level, which hides a small external effort.
    """
    free = free_space(track.t, entry.contact, track.rate)
    if track.at_rest or not entry.has_known_free_motion or int(free.sum()) < MIN_SAMPLES_LEVEL:
        return
    windows = [(start - MARGIN_BEFORE_CONTACT, end) for start, end in entry.contact]
    free_smooth = free_space(track.t, windows, track.rate)
    smooth = free_motion_statistics(track.tau_ext_smooth, free_smooth if free_smooth.any() else free, track.rate)
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
    """Take the highest level of all logs, one Threshold per joint and filter with any free space."""
    by_joint: dict[tuple[str, str], list[FreeSpace]] = {}
    for space in spaces:
        by_joint.setdefault((space.joint, space.filter), []).append(space)
    for (joint, name), joint_spaces in by_joint.items():
        unfitted = [space for space in joint_spaces if space.role != "identification"] or joint_spaces
        worst = max(unfitted, key=lambda space: space.detection_level)
        level, source = max(((alarm_level_of(space), space) for space in unfitted), key=lambda pair: pair[0])
        yield Threshold(
            joint, name, worst.detection_level, worst.detection_level_std, level,
            level * source.free_rms_std / source.free_rms if source.free_rms else 0.0, worst.log,
        )  # fmt: skip


def alarm_level_of(space: FreeSpace) -> float:
    """Alarm level: the effort that free motion exceeds at most once in ten minutes; it grows with its rms."""
    return alarm_level([FreeMotionStatistics(space.smooth_rms, space.smooth_max, space.crossings)])
