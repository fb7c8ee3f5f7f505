"""Steps of a clock across which the motion continues as if one sample had passed."""

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.clock import GAP

REACH = 10  # samples on either side of a step that show whether the motion continues
POLYNOMIAL_ORDER = 4  # a polynomial of this order is fitted to the motion over these samples
BREAK_PROBABILITY = 1e-3  # probability that noise makes a continuous motion look broken
MIN_TRAVEL = 10.0  # a motion over the time of a gap is evidence from this many standard errors on


def steps(t: Array, x: Array) -> list[tuple[int, float]]:
    """Find the first sample after each step of a clock, and the jump beyond one sampling time [s].

    `t` (N,) [s] increases; `x` (J, N) are positions.  A gap is a step of the clock if the motion of no joint jumps
    there.  But a joint must move so fast that it would jump if the time had passed.  Gaps with fewer than `REACH`
    samples on either side are left as they are.
    """
    intervals = np.diff(t)
    T_s = float(np.median(intervals)) if len(intervals) else 0.0
    gaps = (np.flatnonzero(intervals > GAP * T_s) + 1).tolist()
    windows = [(i, x[:, i - REACH : i + REACH]) for i in gaps if REACH <= i <= len(t) - REACH]
    jumps = [(i, part, float(intervals[i - 1]) - T_s) for i, part in windows]
    return [(i, jump) for i, part, jump in jumps if is_continuous(part, jump / T_s)]


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
    smooth, jumping = (_residual(basis, x) for basis in (whole, broken))
    noise = np.maximum(jumping / degrees, 1e-24 * np.maximum(x.var(axis=1), 1e-300))
    if np.any((smooth - jumping) / 2 / noise > fdtri(2, degrees, 1.0 - BREAK_PROBABILITY)):
        return False
    c = np.linalg.lstsq(broken, x.T, rcond=None)[0]
    v_before, v_after = c[1], c[1] + c[POLYNOMIAL_ORDER + 2]
    # A joint that reverses in a gap may return to the same place, so its motion is no evidence.
    per_sample = np.where(v_before * v_after > 0, np.minimum(np.abs(v_before), np.abs(v_after)), 0.0) / REACH
    jump_std = np.sqrt(noise * np.linalg.inv(broken.T @ broken)[POLYNOMIAL_ORDER + 1, POLYNOMIAL_ORDER + 1])
    return bool(np.any(per_sample * min(lost, REACH) > MIN_TRAVEL * jump_std))


def _residual(basis: Array, x: Array) -> Array:
    """Residual sum of squares (J,) of each signal."""
    c = np.linalg.lstsq(basis, x.T, rcond=None)[0]
    return np.asarray(((x.T - basis @ c) ** 2).sum(axis=0))
