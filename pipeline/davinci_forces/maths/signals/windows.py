"""Choose the samples of a recording that are evaluated."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, runs
from davinci_forces.maths.signals.smoothing import segments

UNSCORED_STRETCH, UNSCORED_SAMPLE = 1, 2  # flags of samples that are not scored: with their transients, or alone
MIN_FREE_SAMPLES = 100  # from which errors in free space are computed
TRANSIENT = 1.0  # [s] duration of a filter's transient, left out of the statistics of the whole run
LAST_MOMENTS = 0.5  # [s] of a log in which the low-pass of the motion errs, as it has no later samples


def is_outside(t: Array, windows: Sequence[tuple[float, float]]) -> Booleans:
    """Whether each time (N,) lies outside all windows."""
    inside = np.zeros(len(t), dtype=bool)
    for start, end in windows:
        inside |= (t >= start) & (t <= end)
    return ~inside


def is_past_transient(t: Array) -> Booleans:
    """Whether a filter's transient is over: after the first second, or throughout a run of up to 5 s."""
    return t - t[0] >= TRANSIENT if t[-1] - t[0] > 5 * TRANSIENT else np.ones(len(t), dtype=bool)


def free_space(
    t: Array, windows: Sequence[tuple[float, float]], rate: float, unscored: Integers | None = None, before: float = 0.0
) -> Booleans:
    """Whether nothing touches the robot at each time (N,) and the filter's transient is over; `rate` [Hz].

    There is a transient at the start, after each gap and after each window, and `before` [s] each window.  Samples at
    which no model is scored (N,) are left out, as windows or alone.
    """
    unscored = np.zeros(len(t), np.int64) if unscored is None else unscored
    widened = [(start - before, end + TRANSIENT) for start, end in (*windows, *spans(t, unscored == UNSCORED_STRETCH))]
    steady = np.concatenate([is_past_transient(t[part]) for part in unbroken(t, 1.5 / rate)])
    return np.asarray(is_outside(t, widened) & steady & (unscored == 0))


def free_smoothed(
    t: Array, windows: Sequence[tuple[float, float]], rate: float, unscored: Integers | None = None
) -> Booleans:
    """Free space (N,) for the smoother, which responds to a contact as long before it as after it.

    It and the low-pass of the motion have no later samples in the last moments of a log, which are left out.
    """
    free, long = free_space(t, windows, rate, unscored, TRANSIENT), t[-1] - t[0] > 5 * TRANSIENT
    return np.asarray(free & (t < t[-1] - LAST_MOMENTS)) if long else free


def spans(t: Array, which: Booleans) -> list[tuple[float, float]]:
    """The first and the last time [s] of each run of true samples (N,), at times t (N,)."""
    return [(float(t[run.start]), float(t[run.stop - 1])) for run in runs(which)]


def longest_run(t: Array, rate: float) -> slice:
    """The longest segment, a run of samples without a gap; `rate` [Hz]."""
    return max(unbroken(t, 1.5 / rate), key=lambda part: part.stop - part.start)


def unbroken(t: Array, gap: float) -> list[slice]:
    """Split the times (N,) into runs that are no more than `gap` [s] apart."""
    return segments(np.cumsum(np.append(False, np.diff(t) > gap)[: len(t)], dtype=np.int32))
