"""An excitation trajectory for controllers: its table, from standing still to the end of the first period."""

import io
import math
from collections.abc import Sequence

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, motion
from davinci_forces.maths.excitation.run_in import run_in, shortest
from davinci_forces.simulation.excitation.trajectory import ExcitationTrajectory

RUN_INS = 31  # lengths of the run-in that are tried, from a quarter of a period to a whole one


def csv(excitations: Sequence[ExcitationTrajectory], rate: float, from_rest: bool = True) -> str:
    """The run-in from rest and one period at the controller's rate [Hz]: t, q, dq, ddq, with SI units.

    The period starts at t = 0, so that the run-in has negative times; without `from_rest` it is left out.

    Raises
    ------
    BadRequest
        If the periods differ, a period is no whole number of samples, or no run-in keeps the limits.
    """
    samples = _samples(excitations, rate)
    before = _run_in_samples(excitations, samples, rate) if from_rest else 0
    t = np.arange(-before, samples) / rate
    prefixes = [f"{e.joint.name}." if len(excitations) > 1 else "" for e in excitations]
    header = ",".join(["t", *(f"{p}{symbol}" for p in prefixes for symbol in ("q", "dq", "ddq"))])
    text = io.StringIO()
    table = np.column_stack([t, *(column for e in excitations for column in _motion(e.series, t, before))])
    np.savetxt(text, table, "%.12g", delimiter=",", header=header, comments="", newline="\n")
    return text.getvalue()


def _samples(excitations: Sequence[ExcitationTrajectory], rate: float) -> int:
    """The samples of one period."""
    if not (math.isfinite(rate) and rate > 0):
        raise BadRequest(f"--rate must be positive, not {rate:g}")
    period = excitations[0].series.period
    samples = round(period * rate)
    if any(e.series.period != period for e in excitations):
        raise BadRequest("joints that move together need one period; say which with --period")
    if abs(period * rate - samples) > 1e-9 * samples or samples < 1:
        raise BadRequest(
            f"a period of {period:g} s is {period * rate:g} samples at {rate:g} Hz; choose a period or a rate that "
            "gives a whole number, so that the trajectory repeats exactly"
        )
    return samples


def _run_in_samples(excitations: Sequence[ExcitationTrajectory], samples: int, rate: float) -> int:
    """The samples of the shortest run-in that keeps the limits."""
    durations = np.unique(np.linspace(samples / 4, samples, RUN_INS).round().clip(1)) / rate
    accelerations = [e.problem.limits[2] for e in excitations]
    if duration := shortest([e.series for e in excitations], accelerations, durations):
        return round(duration * rate)
    raise BadRequest(
        "no run-in of up to a period keeps the limits of acceleration; write the period alone, with --no-run-in, and "
        "lead into it by other means"
    )


def _motion(series: Fourier, t: Array, before: int) -> Array:
    """Position, velocity and acceleration (3, K) at t, the first `before` of which are of the run-in."""
    moving = np.array(motion(series, t[before:]))
    return np.hstack([run_in(series, t[:before], -t[0]), moving]) if before else moving
