"""Faults in a recording: stuck positions, saturated efforts, and steps of the effort as the controller starts or stops.

A stuck sensor repeats one value exactly, and then jumps by more than any motion does.  A saturated effort stays exactly
at its largest value, of either sign.  A step is a change that the motion does not explain: of the effort less that of
a model.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, row_blocks
from davinci_forces.maths.signals.windows import runs

MIN_TIME_STUCK = 0.25  # [s] shortest time at one value before a jump
MIN_JUMP_RATIO = 5.0  # of a jump to the largest usual step between samples
USUAL_STEP_QUANTILE = 0.999  # quantile of all steps, taken as the largest step of a motion
MIN_SAMPLES_SATURATED = 5  # in a row at the largest value
END_SHARE = 6  # a start-up ends in the first such part of a recording; the model's error is that of the parts between
MIN_STEP_RATIO = 2.0  # of a step to the largest change between the ends, as of a period that differs from the others


class Stuck(NamedTuple):
    """The time in which a value did not change [s], and the jump that ended it."""

    start: float
    end: float
    jump: float


def find_stuck(t: Array, x: Array) -> list[Stuck]:
    """Find where a signal (N,) at times (N,) [s] repeats a value and then jumps, unlike a joint that was at rest."""
    step = np.abs(np.diff(x))
    repeats = [(run.start, run.stop) for run in runs(step == 0.0)]  # first and last sample at one value
    still = [(a, b) for a, b in repeats if t[b] - t[a] >= MIN_TIME_STUCK and b < len(step)]
    moving = step[step > 0.0] if still else step[:0]
    if not len(moving):
        return []
    usual = float(np.quantile(moving, USUAL_STEP_QUANTILE)) if len(moving) > 1 else np.inf
    # The jumps themselves must not raise the usual step.
    usual = min(usual, float(np.median(moving)) * MIN_JUMP_RATIO)
    jumping = [(a, b) for a, b in still if step[b] > MIN_JUMP_RATIO * usual]
    return [Stuck(float(t[a]), float(t[b]), float(x[b + 1] - x[b])) for a, b in jumping]


def count_saturated(x: Array) -> int:
    """Count the samples of a signal (N,) in runs of several exactly at its largest or its smallest value."""
    levels = [level for level in (x.max(), x.min()) if level != 0.0]
    lengths = [run.stop - run.start for level in levels for run in runs(x == level)]
    return sum(length for length in lengths if length >= MIN_SAMPLES_SATURATED)


def beyond_steps(residual: Array, scored: Booleans, slack: Array, width: int) -> Booleans:
    """The samples (N,) before a step of a residual effort (N,) near the start, or after one near the end.

        D_k = mean of the `width` samples from k on, less that of the `width` samples before k

    Only changes D_k among `scored` samples (N,) count.  A step exceeds twice the largest change between the ends by
    more than the `slack` (N,), which friction explains.
    """
    sums = np.cumsum(np.concatenate([[0.0], residual]))
    excluded = np.cumsum(np.concatenate([[False], ~scored]), dtype=np.int32)
    k = width + np.flatnonzero(excluded[2 * width :] == excluded[: max(len(excluded) - 2 * width, 0)])
    n, beyond = len(k) // END_SHARE, np.zeros(len(residual), np.bool_)

    def size(k: Integers) -> Array:
        return np.asarray(np.abs(sums[k + width] - 2.0 * sums[k] + sums[k - width]) / width)

    if n:
        largest = max(size(k[n:-n][rows]).max() for rows in row_blocks(len(k) - 2 * n))
        start, end = (ks[size(ks) > MIN_STEP_RATIO * largest + slack[ks]] for ks in (k[:n], k[-n:]))
        beyond[: start.max(initial=-width) + width] = True
        beyond[end.min(initial=len(residual) + width) - width :] = True
    return beyond
