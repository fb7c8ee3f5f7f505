"""The way from standing still into a periodic trajectory: along that trajectory itself, slow at first.

    q(sigma(t)),    dq sigma',    ddq sigma'^2 + dq sigma'',    sigma' = 10 u^3 - 15 u^4 + 6 u^5,    u = 1 + t / T

over -T <= t <= 0.  sigma' rises from 0 to 1 with sigma'' = 0 at both ends, so position, velocity and acceleration are
continuous, as is jerk.  Positions and velocities keep every limit that the periodic trajectory keeps; accelerations
keep theirs where T is long enough.
"""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, Range, motion, ranges

FINE = 4000  # instants of a run-in at which the limits are asked for
ROOM = 1e-5  # of a limit, for what may be between them


def run_in(series: Fourier, t: Array, duration: float) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (K,) at the times t (K,) [s] from -duration, at rest, to 0, at full speed."""
    u = 1 + t / duration
    path = duration * (u**4 * (2.5 - 3 * u + u**2) - 0.5)
    speed = u**3 * (10 - 15 * u + 6 * u**2)
    rise = 30 * (u * (1 - u)) ** 2 / duration
    q, dq, ddq = motion(series, path)
    return q, speed * dq, speed**2 * ddq + rise * dq


def shortest(series: Sequence[Fourier], accelerations: Sequence[Range], durations: Array) -> float | None:
    """The first of these durations [s] in which the run-in of every series keeps its limits of acceleration, or None.

    A series that leaves the limits by itself may use in its run-in what it uses anyway.
    """
    bounds = []
    for one, (low, high) in zip(series, accelerations, strict=True):
        lowest, highest = ranges(one)[2]
        bounds.append((min(low * (1 - ROOM), lowest), max(high * (1 - ROOM), highest)))
    for duration in durations.tolist():
        t = np.linspace(-duration, 0.0, FINE)
        used = [run_in(one, t, duration)[2] for one in series]
        if all(low <= ddq.min() and ddq.max() <= high for ddq, (low, high) in zip(used, bounds, strict=True)):
            return float(duration)
    return None
