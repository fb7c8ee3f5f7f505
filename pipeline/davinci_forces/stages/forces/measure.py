"""Measure every contact: where it begins and ends, peak, mean and impulse, against the level of free space."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.identification.used import Identified
from davinci_forces.maths.contact.detection import Event, events, summarise
from davinci_forces.maths.signals.windows import free_space, settled
from davinci_forces.records import Contact, Diagnostic, Fit, Threshold, Track, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

Window = tuple[float, float]
BESIDE = 0.5  # [s] of a window that a contact may begin before it, or end after it


def run(
    track: Track, thresholds: Iterable[Threshold], fits: Iterable[Fit], entry: LogEntry, robot: Robot
) -> Iterator[Contact | Diagnostic]:
    """The contacts of one joint that moves: in windows that the study states, and what else is above the alarm level.

    Of logs that are said to be free, or about contact; of a weight or of tissue that is touched all along, none.
    """
    own = [t for t in thresholds if (t.joint, t.filter) == (track.joint, track.filter)]
    if entry.role not in ("contact", "validation", "identification"):
        return
    if track.at_rest:
        if entry.role == "contact":
            yield hidden(track, fits, robot)
        return
    if not own:
        return
    calm = settled(track.t)
    found = [
        event
        for event in events(track.t, track.tau_ext_smooth, track.tau_ext_std, own[0].alarm_level, track.smooth_rise)
        if calm[np.searchsorted(track.t, event.onset).clip(0, len(calm) - 1)]
    ]
    placed = list(placing(sorted(entry.contact), found))
    if placed:
        yield from contacts(track, own[0], placed, entry)


def placing(windows: Sequence[Window], found: Sequence[Event]) -> Iterator[tuple[Window, Event | None, bool]]:
    """Each stated window with the contact that was found in it, then the contacts that no window states."""
    beside = set(found)
    for start, end in windows:
        inside = [e for e in found if e.onset >= start - BESIDE and e.release <= end + BESIDE]
        beside -= set(inside)
        first, last = (inside[0], inside[-1]) if inside else (None, None)
        event = Event(*first[:2], *last[2:]) if first and last else None
        yield (start, end), event, True
    touching = [(start - BESIDE, end + BESIDE) for start, end in windows]
    for event in found:
        if event in beside and not any(event.onset < end and event.release > start for start, end in touching):
            yield (event.onset, event.release), event, False


def contacts(
    track: Track, threshold: Threshold, placed: Sequence[tuple[Window, Event | None, bool]], entry: LogEntry
) -> Iterator[Contact]:
    """The Contact of one joint of a log, if any sample lies in any of its contacts."""
    windows = [window for window, _, _ in placed]
    free = free_space(track.t, windows, track.rate)
    rows = []
    for window, event, stated in placed:
        summary = summarise(track.t, track.tau_ext, track.tau_ext_std, window, free)
        if summary is not None:
            event, found = event or Event(window[0], 0.0, window[1], 0.0), event is not None
            spread = float(np.hypot(event.onset_std, event.release_std))
            rows.append((int(stated), int(found), *event, event.release - event.onset, spread, *summary))
    if not rows:
        return
    names = (
        "stated", "found", "onset", "onset_std", "release", "release_std", "duration", "duration_std", "peak",
        "peak_std", "mean", "mean_std", "impulse", "impulse_std",
    )  # fmt: skip
    columns = dict(zip(names, np.array(rows).T, strict=True))
    yield Contact(
        log=track.log,
        joint=track.joint,
        filter=track.filter,
        detection_level=threshold.detection_level,
        alarm_level=threshold.alarm_level,
        level_from=threshold.level_from,
        above=np.abs(columns["peak"]) > threshold.detection_level,
        **columns,
    )


def hidden(track: Track, fits: Iterable[Fit], robot: Robot) -> Diagnostic:
    """Up to which effort a contact on a joint at rest cannot be told from stiction."""
    name = f"{track.log}/{track.joint}"
    levels = [
        abs(float(theta))
        for fit in Identified(robot, fits).describing(track.joint)
        if f"{fit.model}.{fit.estimator}" == "independent.lse"
        for parameter, theta in zip(fit.parameter, fit.theta, strict=True)
        if parameter == "Coulomb friction"
    ]
    unit = robot.joint(track.joint).kind.unit("{effort}")
    up_to = f"about {levels[0]:.2g} {unit}, its Coulomb friction, " if levels else "its stiction "
    said = f"{name}: the joint is at rest, where contact of up to {up_to}cannot be told from friction; move the joint"
    return diagnostic("measure", f"{track.log}.{track.joint}", "note", said)
