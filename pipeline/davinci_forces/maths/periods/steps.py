"""Steps of a clock across which the motion goes on as if one sample had passed."""

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.clock import GAP

REACH = 10  # samples on either side of a step that say whether the motion goes on
ORDER = 4  # of the polynomial that a motion follows over so few samples
CHANCE = 1e-3  # that noise breaks a motion that goes on
TELLS = 10.0  # standard errors that a motion has to cover in the time that is in question


def steps(t: Array, x: Array) -> list[tuple[int, float]]:
    """The first sample after each step of a clock, and how far it jumped beyond one sampling time [s].

    `t` (N,) [s] increases; `x` (J, N) are positions.  A gap is a step where the motion tells that it is: no joint
    breaks there, and some joint moves fast enough that it would, had the time passed.  Gaps with fewer than `REACH`
    samples on either side are left as they are.
    """
    intervals = np.diff(t)
    T_s = float(np.median(intervals)) if len(intervals) else 0.0
    gaps = (np.flatnonzero(intervals > GAP * T_s) + 1).tolist()
    around = [(i, x[:, i - REACH : i + REACH]) for i in gaps if REACH <= i <= len(t) - REACH]
    jumps = [(i, part, float(intervals[i - 1]) - T_s) for i, part in around]
    return [(i, jump) for i, part, jump in jumps if goes_on(part, jump / T_s)]


def goes_on(x: Array, lost: float) -> bool:
    """Whether positions (J, 2 `REACH`) go on in the middle as if one sample had passed there, and not `lost` more.

    A polynomial is fitted with and without a jump of its value and slope in the middle: the test of whether it needs
    them is Fisher's F.
    """
    from scipy.special import fdtri

    s = (np.arange(2 * REACH) - (REACH - 0.5)) / REACH
    after = (s > 0).astype(float)
    whole = np.vander(s, ORDER + 1, increasing=True)
    broken = np.column_stack([whole, after, after * s])
    degrees = len(s) - broken.shape[1]
    one, two = (_residual(basis, x) for basis in (whole, broken))
    noise = np.maximum(two / degrees, 1e-24 * np.maximum(x.var(axis=1), 1e-300))
    if np.any((one - two) / 2 / noise > fdtri(2, degrees, 1.0 - CHANCE)):
        return False
    c = np.linalg.lstsq(broken, x.T, rcond=None)[0]
    before, behind = c[1], c[1] + c[ORDER + 2]
    # A motion that turns here need not be far away when time has passed, and tells nothing.
    per_sample = np.where(before * behind > 0, np.minimum(np.abs(before), np.abs(behind)), 0.0) / REACH
    jump_std = np.sqrt(noise * np.linalg.inv(broken.T @ broken)[ORDER + 1, ORDER + 1])
    return bool(np.any(per_sample * min(lost, REACH) > TELLS * jump_std))


def _residual(basis: Array, x: Array) -> Array:
    """Sums of squares (J,) that a fit leaves of each signal."""
    c = np.linalg.lstsq(basis, x.T, rcond=None)[0]
    return np.asarray(((x.T - basis @ c) ** 2).sum(axis=0))
