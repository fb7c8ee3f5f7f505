"""Faults in a recording: stuck positions, saturated efforts, and steps of the effort and of the clock.

A stuck sensor repeats one value exactly, and then jumps by more than any motion does.  A saturated effort stays exactly
at its largest value, of either sign.  A step is a change that the motion does not explain: of the effort less that of
a model, as the controller starts or stops.  Across a step of the clock the motion goes on as after one sample.
"""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, row_blocks, runs
from davinci_forces.maths.signals.clock import GAP

MIN_TIME_STUCK = 0.25  # [s] shortest time at one value before a jump
MIN_JUMP_RATIO = 5.0  # of a jump to the largest usual step between samples
USUAL_STEP_QUANTILE = 0.999  # quantile of all steps, taken as the largest step of a motion
MIN_SAMPLES_SATURATED = 5  # in a row at the largest value
END_SHARE = 6  # a start-up ends in the first such part of a recording; the model's error is that of the parts between
MIN_STEP_RATIO = 2.0  # of a step to the largest change between the ends, as of a period that differs from the others
REACH = 10  # samples on either side of a step that show whether the motion continues
POLYNOMIAL_ORDER = 4  # a polynomial of this order is fitted to the motion over these samples
BREAK_PROBABILITY = 1e-3  # probability that noise makes a continuous motion look broken
MAX_RATE_CHANGE = 0.1  # of the mean interval before a step to that after it
MAX_PAUSE = 86400.0  # [s] a recorder that waits for the motion to repeat does not wait longer
SAME_PLACE = 0.6  # of the largest travel between samples; half a sample's travel, and noise
MIN_TRAVEL = 10.0  # a motion over the time of a gap is evidence from this many standard errors on


def find_stuck(t: Array, x: Array) -> list[tuple[float, float, float]]:
    """Find where a signal (N,) at times (N,) [s] repeats a value and then jumps, unlike a joint that was at rest.

    Returns the start and the end [s] of each time in which the value did not change, and the jump that ended it.
    """
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
    return [(float(t[a]), float(t[b]), float(x[b + 1] - x[b])) for a, b in jumping]


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


def steps(t: Array, x: Array) -> list[tuple[int, float]]:
    """Find the first sample after each step of a clock, and the jump beyond one sampling time [s].

    `t` (N,) [s]; `x` (J, N) are positions.  An interval is a step of the clock if it stands alone between stretches of
    one sampling time, and the motion of no joint jumps there.  But a joint must move so fast that it would jump if the
    time had passed.  Intervals with fewer than `REACH` samples on either side are left as they are, and so is a time
    after which the motion would be the same because it repeats.
    """
    intervals = np.diff(t)
    T_s = float(np.median(intervals)) if len(intervals) else 0.0
    odd = (np.flatnonzero((intervals > GAP * T_s) | (intervals <= 0.0)) + 1).tolist()
    alone = [i for i in odd if REACH <= i <= len(t) - REACH and stands_alone(intervals[i - REACH : i + REACH - 1])]
    jumps = [(i, float(intervals[i - 1]) - float(np.median(intervals[i - REACH : i + REACH - 1]))) for i in alone]
    return [
        (i, jump)
        for i, jump in jumps
        if is_continuous(x[:, i - REACH : i + REACH], abs(jump) / T_s) and not may_have_repeated(t, x, i, jump)
    ]


def stands_alone(intervals: Array) -> bool:
    """Whether all intervals (2 `REACH` - 1,) between samples but the middle one are usual ones, alike on both sides."""
    before, after = intervals[: REACH - 1], intervals[REACH:]
    usual = float(np.median(np.concatenate([before, after])))
    alike = abs(float(before.mean()) - float(after.mean())) <= MAX_RATE_CHANGE * usual
    return alike and bool(max(before.max(), after.max()) < GAP * usual and min(before.min(), after.min()) > 0.0)


def may_have_repeated(t: Array, x: Array, i: int, jump: float) -> bool:
    """Whether a motion (J, N) that repeats explains that it continues at sample `i`, although the time has passed.

    The motion repeats after each lag before which all joints were in the same place, to `SAME_PLACE` of a sample's
    travel.  The jump is then a multiple of the lag, to half a sample for each.
    """
    if not 0.0 < jump < MAX_PAUSE:
        return False
    recent = x[:, i - REACH : i]
    travel = SAME_PLACE * np.abs(np.diff(recent, axis=1)).max(axis=1)
    earlier = np.lib.stride_tricks.sliding_window_view(x[:, : i - REACH], REACH, axis=1)
    distance = np.abs(earlier - recent[:, None]).max(axis=2)
    lags = t[i - REACH] - t[np.flatnonzero(np.all(distance <= travel[:, None], axis=0))]
    T_s = float(np.median(np.diff(t[i - REACH : i])))
    many = np.maximum(np.rint(jump / lags), 1.0)
    return bool(np.any(np.abs(jump - many * lags) <= (1.0 + many) * T_s / 2))


def is_continuous(x: Array, lost: float) -> bool:
    """Whether positions (J, 2 `REACH`) continue in the middle as if one sample had passed there, and not `lost` more.

    A polynomial is fitted with and without a jump of its value and slope in the middle, and compared by an F test.
    """
    from scipy.special import fdtri

    s = (np.arange(2 * REACH) - (REACH - 0.5)) / REACH
    after = (s > 0).astype(float)
    whole = np.vander(s, POLYNOMIAL_ORDER + 1, increasing=True)
    broken = np.column_stack([whole, after, after * s])
    degrees = len(s) - broken.shape[1]
    fits = [(basis, np.linalg.lstsq(basis, x.T, rcond=None)[0]) for basis in (whole, broken)]
    smooth, jumping = (((x.T - basis @ c) ** 2).sum(axis=0) for basis, c in fits)  # residual squares (J,)
    noise = np.maximum(jumping / degrees, np.maximum(1e-24 * x.var(axis=1), 1e-300))  # also of a joint at rest at 0
    if np.any((smooth - jumping) / 2 / noise > fdtri(2, degrees, 1.0 - BREAK_PROBABILITY)):
        return False
    _, c = fits[1]
    v_before, v_after = c[1], c[1] + c[POLYNOMIAL_ORDER + 2]
    # A joint that reverses in a gap may return to the same place, so its motion is no evidence.
    per_sample = np.where(v_before * v_after > 0, np.minimum(np.abs(v_before), np.abs(v_after)), 0.0) / REACH
    jump_std = np.sqrt(noise * np.linalg.inv(broken.T @ broken)[POLYNOMIAL_ORDER + 1, POLYNOMIAL_ORDER + 1])
    return bool(np.any(per_sample * min(lost, REACH) > MIN_TRAVEL * jump_std))
