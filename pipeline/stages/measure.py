"""Measure every contact: peak, mean and impulse of the external effort in its window, against the detection level."""

from collections.abc import Iterable, Iterator

import numpy as np

from pipeline.maths.contact.window import summarise
from pipeline.maths.signals.windows import free_space
from pipeline.records import Contact, Threshold, Track
from pipeline.study import LogEntry


def run(track: Track, thresholds: Iterable[Threshold], entry: LogEntry) -> Iterator[Contact]:
    """The windows of contact that the study states, on one joint that moves."""
    own = [t for t in thresholds if (t.joint, t.filter) == (track.joint, track.filter)]
    if track.at_rest or not own or not entry.contact:
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
        detection_level=own[0].detection_level,
        level_from=own[0].level_from,
        onset=np.array(onset),
        release=np.array(release),
        above=np.array([int(abs(row.peak) > own[0].detection_level) for row in measured]),
        **columns,
    )
