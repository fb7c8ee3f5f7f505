"""What a recording shows of sensors that failed: positions that stood still, and effort at its stop.

A sensor that is stuck repeats one value exactly, and leaves it by a jump no motion makes.  An effort that is saturated
stays exactly at its largest value, of either sign.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.windows import runs

STUCK = 0.25  # [s] of one value, before a jump that is called one
JUMP = 5.0  # times the largest usual step between samples
USUAL = 0.999  # of all steps
SATURATED = 5  # samples in a row at the largest value


class Stuck(NamedTuple):
    """When a value did not change [s], and by how much it jumped then."""

    start: float
    end: float
    jump: float


def stuck(t: Array, x: Array) -> list[Stuck]:
    """Where a signal (N,) at times (N,) [s] repeats a value and then jumps, which no rest of a joint ends in."""
    step = np.abs(np.diff(x))
    still = [(a, b) for a, b in repeated(step == 0.0) if t[b] - t[a] >= STUCK and b < len(step)]
    moving = step[step > 0.0] if still else step[:0]
    if not len(moving):
        return []
    usual = float(np.quantile(moving, USUAL)) if len(moving) > 1 else np.inf
    # The jumps themselves must not set what is usual.
    usual = min(usual, float(np.median(moving)) * JUMP)
    return [Stuck(float(t[a]), float(t[b]), float(x[b + 1] - x[b])) for a, b in still if step[b] > JUMP * usual]


def saturated(x: Array) -> int:
    """How many samples of a signal (N,) lie in rows of several exactly at its largest or its least value."""
    return sum(
        b - a + 1
        for level in (x.max(), x.min())
        for a, b in repeated((x[:-1] == level) & (x[1:] == level))
        if b - a + 1 >= SATURATED and level != 0.0
    )


def repeated(same: Booleans) -> list[tuple[int, int]]:
    """The first and last sample of each run in which each sample is the `same` (N-1,) as the next."""
    return [(run.start, run.stop) for run in runs(same)]
