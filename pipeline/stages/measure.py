"""Measure every contact: peak, mean and impulse of the external effort in its window, against the detection level."""

from collections.abc import Iterable, Iterator

import numpy as np

from pipeline.maths.contact.window import summarise
from pipeline.maths.signals.windows import free_space
from pipeline.records import Contact, FreeSpace, Track
from pipeline.study import LogEntry


def run(track: Track, spaces: Iterable[FreeSpace], entry: LogEntry) -> Iterator[Contact]:
    """The windows of contact that the study states, on one joint that moves."""
    judge = worst([space for space in spaces if space.joint == track.joint])
    if track.at_rest or judge is None or not entry.contact:
        return
    free = free_space(track.t, entry.contact, track.rate)
    summaries = [(window, summarise(track.t, track.tau_ext, window, free)) for window in sorted(entry.contact)]
    rows = [(start, end, summary) for (start, end), summary in summaries if summary is not None]
    if not rows:
        return
    onset, release, measured = zip(*rows, strict=True)
    columns = dict(zip(measured[0]._fields, np.array(measured).T, strict=True))
    yield Contact(
        log=track.log,
        joint=track.joint,
        filter=track.filter,
        detection_level=judge.detection_level,
        level_from=judge.log,
        onset=np.array(onset),
        release=np.array(release),
        above=np.array([int(abs(row.peak) > judge.detection_level) for row in measured]),
        **columns,
    )


def worst(spaces: list[FreeSpace]) -> FreeSpace | None:
    """The free space with the highest detection level, of logs that no parameter was fitted to where there are any."""
    unseen = [space for space in spaces if space.role != "identification"]
    return max(unseen or spaces, key=lambda space: space.detection_level, default=None)
