"""Compute two levels from free motion: contacts are found above the alarm level, and the other judges their peaks."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.filters.error_bands import joint_alarm_level
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.contact.detection import free_motion_statistics, typical_alarm_level
from davinci_forces.maths.signals import windows
from davinci_forces.maths.signals.standstill import is_far_from_reversals
from davinci_forces.maths.signals.windows import MIN_FREE_SAMPLES, free_smoothed, free_space, is_outside
from davinci_forces.maths.uncertainty.error_band import MIN_LOGS_BAND, NORMAL_95, coverage_by_speed, levels
from davinci_forces.records import Diagnostic, FreeSpace, Threshold, Track, by_name, diagnostic
from davinci_forces.records.forces import SMOOTHER
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

MAX_FITTED = 2.0  # largest effort of a fitted log over its typical alarm level, beyond which it is a touch
MAX_TOUCHES = 2  # of a fitted log: what comes again and again is an error of the model
MAX_SHARE_FREE = 0.5  # of a log of validation that may give its offset
TOUCHED = 3.0  # largest effort of a log over its typical alarm level; recorded free motion stays below 1.7


def run(track: Track, entry: LogEntry, robot: Robot) -> Iterator[FreeSpace | Diagnostic]:
    """Compute the levels of one moving joint, by smoother and by filter, in a log in which contacts are known.

    Standstill is left out: friction takes any value up to its static level, which hides a small external effort.
    """
    if track.at_rest or not entry.has_known_free_motion:
        return
    smoothed, filtered = (
        which(track.t, entry.possible_contact, track.rate, track.unscored) for which in (free_smoothed, free_space)
    )
    stated = ~is_outside(track.t, entry.free)
    share = float(np.mean(stated))
    if entry.role == "validation" and share > MAX_SHARE_FREE:
        name, why = f"{track.log}/{track.joint}", "so levels and coverage come from the samples that gave its offset"
        message = f"{name}: `free` covers {share:.0%} of the log, {why}, and are too good; state only a part of it"
        yield diagnostic("assess", f"{track.log}.{track.joint}.free", "note", message)
    yield from space_of(track, SMOOTHER, track.tau_ext_smooth, track.tau_ext_smooth_std, smoothed, stated)
    yield from space_of(track, track.filter, track.tau_ext, track.tau_ext_std, filtered, stated)
    doubted = smoothed & ~stated if entry.role == "identification" else smoothed
    if int(doubted.sum()) >= MIN_FREE_SAMPLES:
        yield from touch_warning(track, doubted, entry, robot)


def touch_warning(track: Track, free: Booleans, entry: LogEntry, robot: Robot) -> Iterator[Diagnostic]:
    """Warn of efforts in free motion (N,) that are far above those of the rest of the log, as touches are.

    Where the joint slows down to stop or to reverse, its friction may be the cause.
    """
    moving = free & is_far_from_reversals(track.dq, 1.0 / track.rate)
    if not moving.any():
        return
    size = np.where(moving, np.abs(track.tau_ext_smooth), 0.0)
    level = typical_alarm_level(track.tau_ext_smooth, free, track.rate)
    if size.max() > TOUCHED * level > 0.0:
        effort = f"{size.max():.2g} {robot.joint(track.joint).unit('{effort}')}"
        if entry.role != "contact":
            remedy = "give the log the role contact, or state its contact windows"
        elif entry.free:
            remedy = "leave this time out of its free windows"
        else:
            remedy = "add this time to its contact windows, or state in its free windows when nothing touched the arm"
        what = f"{track.log}/{track.joint}: at {track.t[size.argmax()]:.2f} s something seems to touch the arm"
        why = f"the external effort is {effort}, {size.max() / level:.0f} times as large as elsewhere in the log"
        message = f"{what}: {why}; {remedy}"
        yield diagnostic("assess", f"{track.log}.{track.joint}", "warning", message)


def space_of(
    track: Track, name: str, tau_ext: Array, std: Array, free: Booleans, stated: Booleans
) -> Iterator[FreeSpace]:
    """The levels of an external effort (N,) with its deviation (N,) in free space, if that has enough samples.

    The largest effort of a log that identifies is at most twice its typical alarm level: beyond, something touched it,
    unless that comes more often than touches do.
    Samples (N,) that the study has `stated` to be free count as they are.
    """
    if int(free.sum()) < MIN_FREE_SAMPLES:
        return
    space, statistics = levels(tau_ext[free], std[free]), free_motion_statistics(tau_ext, free, track.rate)
    if track.role == "identification":
        highest = MAX_FITTED * typical_alarm_level(tau_ext, free, track.rate)
        if len(windows.unbroken(track.t[free & (np.abs(tau_ext) > highest)], windows.TRANSIENT)) > MAX_TOUCHES:
            highest = statistics.free_max
        largest_stated = float(np.abs(tau_ext[free & stated]).max(initial=0.0))
        statistics = statistics._replace(free_max=max(min(statistics.free_max, highest), largest_stated))
    coverage, coverage_std = coverage_by_speed(tau_ext[free], std[free], track.dq[free])
    yield FreeSpace.like(
        space,
        statistics,
        track,
        filter=name,
        tested=int(np.sum(free)),
        band_width=NORMAL_95 * float(std[free].mean()),
        quartile_coverage=coverage,
        quartile_coverage_std=coverage_std,
    )


def gather(spaces: Iterable[FreeSpace]) -> Iterator[Threshold]:
    """Take the highest level of all logs, one Threshold per joint with any free space, by the smoother."""
    smoothed = (space for space in spaces if space.filter == SMOOTHER)
    for joint, joint_spaces in by_name(smoothed, "joint").items():
        unfitted = [space for space in joint_spaces if space.role != "identification"] or joint_spaces
        worst = max(unfitted, key=lambda space: space.detection_level)
        level, source = joint_alarm_level(joint_spaces)
        yield Threshold(
            joint, SMOOTHER, worst.detection_level, worst.detection_level_std, level,
            level * source.free_rms_std / source.free_rms if source.free_rms else 0.0, worst.log, len(unfitted),
            *pooled_coverage(unfitted), float(np.mean([space.band_width for space in unfitted])),
        )  # fmt: skip


def pooled_coverage(spaces: list[FreeSpace]) -> tuple[float, float]:
    """Mean coverage of logs, with its standard error by logs, or by the blocks of the logs if logs are few."""
    shares, errors = (np.array([getattr(space, name) for space in spaces]) for name in ("coverage", "coverage_std"))
    by_blocks = float(np.sqrt(np.sum(errors**2))) / len(shares)
    by_logs = float(np.std(shares, ddof=1)) / len(shares) ** 0.5 if len(shares) >= MIN_LOGS_BAND else 0.0
    return float(shares.mean()), max(by_blocks, by_logs)
