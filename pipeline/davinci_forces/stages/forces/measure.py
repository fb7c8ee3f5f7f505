"""Measure every contact: onset, release, peak, mean and impulse, compared with the effort level in free space."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.contact import detection
from davinci_forces.maths.contact.detection import Event
from davinci_forces.maths.signals.standstill import SLOW
from davinci_forces.maths.signals.windows import (
    LAST_MOMENTS,
    TRANSIENT,
    free_smoothed,
    is_outside,
    is_past_transient,
    spans,
)
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Contact, Diagnostic, Threshold, Track, diagnostic
from davinci_forces.records.forces import SMOOTHER
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

Window = tuple[float, float]
WINDOW_MARGIN = 0.5  # [s] by which a contact may begin before its window, or end after it


def run(track: Track, thresholds: Iterable[Threshold], entry: LogEntry, robot: Robot) -> Iterator[Contact | Diagnostic]:
    """Measure the contacts of one joint: in windows that the study states, and others above the alarm level.

    At standstill a contact exceeds the alarm level by more than the static friction, which any effort there may be.
    Outside the windows, what static friction explains while the joint slowly reverses is noted, and is no contact.
    In the last moments of a log smoother and low-pass have no later samples, so no contact begins there.
    A window on a joint at rest counts only if a contact was detected in it.
    Logs of a weight or of tissue are left out, because the arm is loaded throughout.
    """
    if entry.role not in ("contact", "validation", "identification"):
        return
    if track.at_rest and entry.role == "contact":
        yield stiction_note(track, robot)
    threshold = next((t for t in thresholds if (t.joint, t.filter) == (track.joint, SMOOTHER)), None)
    if threshold is None:
        return
    last_moments = max(detection.TIP_REACH * track.smooth_rise, LAST_MOMENTS)
    steady = is_past_transient(track.t) & (track.t <= track.t[-1] - last_moments)
    level = threshold.alarm_level + unknown_friction(track)
    detected = [
        event
        for event in detection.events(track.t, *steady_effort(track), level, track.smooth_rise)
        if steady[np.searchsorted(track.t, event.onset).clip(0, len(steady) - 1)]  # an unknown rise makes onsets NaN
    ]
    pairs = match_windows(sorted(entry.contact), detected)
    placed = [(window, event, stated) for window, event, stated in pairs if event or not track.at_rest]
    friction = [window for window, _, stated in placed if not stated and is_friction(track, window)]
    if friction:
        yield friction_note(track, friction, robot)
    if placed := [pair for pair in placed if pair[0] not in friction]:
        yield from contacts(track, threshold, placed)


def match_windows(windows: Sequence[Window], detected: Sequence[Event]) -> Iterator[tuple[Window, Event | None, bool]]:
    """Pair each stated window with the contact that was detected in it; then yield the contacts without a window.

    The errors of onset and release are at least what they lie outside the window.
    """
    unstated = set(detected)
    for start, end in windows:
        inside = [e for e in detected if is_within(e, (start - WINDOW_MARGIN, end + WINDOW_MARGIN))]
        unstated -= set(inside)
        event = Event(*inside[0][:2], *inside[-1][2:]) if inside else None
        if event:  # what lies outside its window contradicts it by as much
            early, late = max(event.onset_std, start - event.onset), max(event.release_std, event.release - end)
            event = event._replace(onset_std=early, release_std=late)
        yield (start, end), event, True
    widened = [(start - WINDOW_MARGIN, end + WINDOW_MARGIN) for start, end in windows]
    for event in detected:
        if event in unstated and not any(event.onset < end and event.release > start for start, end in widened):
            yield (event.onset, event.release), event, False


def is_within(event: Event, window: Window) -> bool:
    """Whether a contact and a window share at least half of the shorter of the two."""
    shared = min(event.release, window[1]) - max(event.onset, window[0])
    return shared > 0.0 and shared >= 0.5 * min(event.release - event.onset, window[1] - window[0])


def contacts(
    track: Track, threshold: Threshold, placed: Sequence[tuple[Window, Event | None, bool]]
) -> Iterator[Contact | Diagnostic]:
    """The Contact of one joint of a log, if any sample lies in one of the joint's contacts, and any outside them.

    A contact is not found, nor above the detection level, if the 95 % interval of its peak holds zero, as where the
    arm swings after a larger push.  What the smoother rounds off does not count in that interval: it makes a peak
    smaller, never larger.  A peak is at least the mean, and that of the middle half.
    """
    windows = [window for window, _, _ in placed]
    free = free_smoothed(track.t, windows, track.rate, track.unscored)
    free = free if free.any() else free_smoothed(track.t, windows, track.rate)
    if not free.any():
        name = f"{track.log}/{track.joint}"
        remedy = "record some free motion, too, or check units and columns if nothing touched the arm"
        text = f"{name}: contacts take up the whole log, so none is measured; {remedy}"
        yield diagnostic("measure", f"{track.log}.{track.joint}", "warning", text)
        return
    is_above = np.abs(track.tau_ext_smooth) > threshold.detection_level + unknown_friction(track)
    friction_std = np.asarray(track.static_friction / 3**0.5 * track.standing, np.float64)
    effort = (*steady_effort(track), track.tau_ext_direct)
    means = detection.narrower_means(track.t, track.tau_ext_direct, free, track.smooth_rise)
    rows, short = [], []
    for window, event, stated in placed:
        summary = detection.summarise(track.t, effort, window, free, track.smooth_rise, means, friction_std)
        clear = summary is not None and abs(summary.largest) > NORMAL_95 * summary.noise_std
        event = event if clear else None
        if summary is not None and (event or (stated and not track.at_rest)):
            onset, onset_std, release, release_std = times = event or Event(window[0], 0.0, window[1], 0.0)
            duration = (release - onset, float(np.hypot(onset_std, release_std)))
            edges = np.interp([onset, release], track.t, track.tau_ext_smooth) * (onset_std, release_std)
            middle = middle_effort(track, Event(*times), free, friction_std) or summary[2:4]
            impulse = summary.impulse, float(np.linalg.norm([summary.impulse_std, *(() if stated else edges)]))
            # A short peak is flattened below the means; its error stays.
            peak = max(summary.peak, summary.mean, middle[0], key=lambda x: x * np.sign(summary.peak))
            above = clear and bool(is_above[~is_outside(track.t, [window])].any())
            measured = (*times, *duration, summary.t_peak, peak, *summary[1:4], *middle, *impulse)
            rows.append((stated, event is not None, above, *measured))
            if not stated and release - onset < track.smooth_rise:
                short.append(hidden_peak(track, onset))
    if short:
        yield diagnostic("measure", f"{track.log}.{track.joint}.short", "warning", *short)
    if not rows:
        return
    names = (
        "stated", "found", "above", "onset", "onset_std", "release", "release_std", "duration", "duration_std",
        "t_peak", "peak", "peak_std", "mean", "mean_std", "middle_mean", "middle_mean_std", "impulse", "impulse_std",
    )  # fmt: skip
    yield Contact.like(threshold, log=track.log, **dict(zip(names, np.array(rows).T, strict=True)))


def steady_effort(track: Track) -> tuple[Array, Array]:
    """The smoothed effort (N,) and its deviation (N,) without what is rounded off, which is added to that of a peak."""
    return track.tau_ext_smooth, detection.without_rounding(track.tau_ext_smooth_std, track.tau_ext_rounding)


def middle_effort(track: Track, event: Event, free: Booleans, friction_std: Array) -> tuple[float, float] | None:
    """Mean effort over the middle half of a contact, and its standard error; None without a sample in it.

    A push that is held has risen by then, unlike in the mean, and noise does not raise it, as it does a peak.  The
    error includes those of onset and release: half the change of the mean when either moves from one side to the other.
    """
    onset, onset_std, release, release_std = event

    def middle(start: float, end: float) -> Window:
        return 0.75 * start + 0.25 * end, 0.25 * start + 0.75 * end

    def change(*windows: Window) -> float:
        first, last = (track.tau_ext_direct[~is_outside(track.t, [middle(*window)])] for window in windows)
        return 0.5 * float(last.mean() - first.mean()) if len(first) and len(last) else 0.0

    if is_outside(track.t, [middle(onset, release)]).all():
        return None
    value, std = detection.mean_effort(track.t, track.tau_ext_direct, middle(onset, release), free, friction_std)
    by_onset = change((onset - onset_std, release), (onset + onset_std, release))
    by_release = change((onset, release - release_std), (onset, release + release_std))
    return value, float(np.linalg.norm([std, by_onset, by_release]))


def hidden_peak(track: Track, onset: float) -> str:
    """State that a contact is too short for its peak to be seen."""
    text = f"{track.log}/{track.joint}: the contact at {onset:.4g} s is shorter than {track.smooth_rise:.2g} s, "
    why = "which the smoother takes to show a step, so its peak may be several times larger: read its impulse"
    return f"{text}{why}; if nothing touched the arm then, it is an error of the model"


def unknown_friction(track: Track) -> Array:
    """The static friction (N,) where the joint stands still, and 0 elsewhere.

    The smoother spreads what it shows at standstill as a filter's transient does, to both sides.
    """
    spread = [(start - TRANSIENT, end + TRANSIENT) for start, end in spans(track.t, track.standing > 0)]
    return np.where(is_outside(track.t, spread), 0.0, track.static_friction)


def is_friction(track: Track, window: Window) -> bool:
    """Whether static friction explains the effort in a window: it is larger, and the joint may stick as it reverses.

    A joint that creeps in one direction slides, so its friction is known.
    """
    dq, slow = track.dq[~is_outside(track.t, [window])], SLOW * np.sqrt(np.mean(track.dq**2))
    sticks = len(dq) > 0 and -slow <= dq.min() <= 0.0 <= dq.max() <= slow
    return bool(sticks) and largest_effort(track, window) <= track.static_friction


def largest_effort(track: Track, window: Window) -> float:
    """The largest smoothed effort in a window."""
    return float(np.abs(track.tau_ext_smooth[~is_outside(track.t, [window])]).max(initial=0.0))


def friction_note(track: Track, windows: Sequence[Window], robot: Robot) -> Diagnostic:
    """Note the efforts that static friction explains, so that they do not count as contacts."""
    unit = robot.joint(track.joint).unit("{effort}")
    first = f"at {windows[0][0]:.4g} s" + (f", the first of {len(windows)}," if windows[1:] else "")
    largest = max(largest_effort(track, window) for window in windows)
    what = f"{track.log}/{track.joint}: an effort {first} of up to {largest:.2g} {unit} does not count as a contact"
    why = "the joint reverses so slowly that static friction may be the cause"
    remedy = "state a window of contact in study.toml if something touched the arm"
    text = f"{what}: {why} (up to {track.static_friction:.2g} {unit}); {remedy}"
    return diagnostic("measure", f"{track.log}.{track.joint}.friction", "note", text)


def stiction_note(track: Track, robot: Robot) -> Diagnostic:
    """Note the effort up to which static friction hides a contact on a joint at rest."""
    effort = f"{track.static_friction:.2g} {robot.joint(track.joint).unit('{effort}')}"
    message = f"{track.log}/{track.joint}: the joint is at rest, so static friction hides a contact of up to {effort}"
    return diagnostic("measure", f"{track.log}.{track.joint}", "note", f"{message}; move the joint")
