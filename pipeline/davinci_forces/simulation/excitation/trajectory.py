"""Excitation trajectories: their properties, their plot, and their table for controllers, which begins at rest."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.files import json_number
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation import fourier
from davinci_forces.maths.excitation.joint import ExcitationProblem
from davinci_forces.maths.excitation.limits import ArmLimits
from davinci_forces.robots.robot import Joint, Kind
from davinci_forces.toml import unlikely

PERIODS = {Kind.REVOLUTE: 10.0, Kind.PRISMATIC: 5.0}  # [s] default periods, from Table 6.1
PLOTS = (".svg", ".png", ".pdf")
RUN_INS = 31  # candidate lengths of the run-in, from a quarter of a period to one period


class ExpectedParameter(NamedTuple):
    """A parameter, and the standard error with which one period is expected to identify it."""

    name: str
    unit: str
    std: float


@dataclass(frozen=True)
class ExcitationTrajectory:
    """A trajectory of one joint, and the excitation problem for which it is designed or evaluated."""

    joint: Joint
    problem: ExcitationProblem
    series: fourier.Fourier
    optima: tuple[float, ...] = ()  # the criterion that each start of the search reached
    noise: float = 0.0  # standard deviation of the effort's noise, or 0 if unknown

    @property
    def standard_errors(self) -> tuple[ExpectedParameter, ...]:
        """The standard errors of the parameters, if the noise is known."""
        if not self.noise:
            return ()
        std = fourier.expected_std(self._F(), np.full(self.problem.samples, self.noise)).tolist()
        terms = zip(self.problem.terms, std, strict=True)
        return tuple(ExpectedParameter(term.name, self.joint.unit(term.unit), value) for term, value in terms)

    @property
    def objective(self) -> float:
        """The criterion: -log10 det(F^T F), or log10 of the condition number.  (6.20)"""
        return float(fourier.CRITERIA[self.problem.criterion](self._F()))

    @property
    def condition(self) -> float:
        """The condition number of F."""
        return float(10 ** fourier.condition(self._F()))

    @property
    def violations(self) -> list[str]:
        """The limits that the trajectory exceeds, one a line."""
        unit, ranges = self.joint.unit("{position}"), fourier.ranges(self.series)
        symbols = (("q", ""), ("dq", "/s"), ("ddq", "/s^2"))
        return [
            f"{name} goes from {lowest:.4f} to {highest:.4f} {unit}{per}, its limits are {low:g} and {high:g}"
            for (name, per), (lowest, highest), (low, high) in zip(symbols, ranges, self.problem.limits, strict=True)
            if lowest < low or highest > high
        ]

    def facts(self) -> dict[str, Any]:
        """All properties, in JSON's types."""
        names = ("a0", *(f"{letter}{k}" for k in range(1, len(self.series.a) + 1) for letter in "ab"))
        symbols = ("q", "dq", "ddq")
        return {
            "joint": self.joint.name,
            "criterion": self.problem.criterion,
            "objective": json_number(self.objective),
            "condition": json_number(self.condition),
            "coefficients": dict(zip(names, self.series.x.tolist(), strict=True)),
            "period": self.series.period,
            "samples": self.problem.samples,
            "ranges": {s: list(r) for s, r in zip(symbols, fourier.ranges(self.series), strict=True)},
            "limits": {s: [json_number(x) for x in r] for s, r in zip(symbols, self.problem.limits, strict=True)},
            "within_limits": not self.violations,
            **({"starts": spread(self.optima)} if self.optima else {}),
            **as_facts(self.standard_errors),
        }

    def _F(self) -> Array:
        return fourier.observation(self.problem.terms, self.series, self.problem.samples)


def as_facts(standard_errors: Sequence[ExpectedParameter]) -> dict[str, Any]:
    """Expected standard errors in JSON's types; nothing without noise."""
    stated = {p.name: {"std": json_number(p.std), "unit": p.unit} for p in standard_errors}
    return {"standard_errors": stated} if stated else {}


def spread(optima: Sequence[float]) -> dict[str, float | int | None]:
    """The agreement of a search's starts: their number, and the best, median and worst optimum."""
    ordered = [json_number(value) for value in sorted(optima)]
    best, median, worst = ordered[0], ordered[(len(ordered) - 1) // 2], ordered[-1]
    return {"number": len(optima), "best": best, "median": median, "worst": worst}


def plot(excitations: Sequence[ExcitationTrajectory], path: Path) -> None:
    """Plot the motion of a period with its limits; raises BadRequest if `path` ends in none of PLOTS.  Fig 6.5"""
    if path.suffix not in PLOTS:
        raise BadRequest(f"{path}: the name of a plot must end in {', '.join(PLOTS)}")
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "davinci-forces"}):
        figure = Figure(figsize=(4.5 * len(excitations), 6.5), layout="constrained")
        for axes, excitation in zip(figure.subplots(3, len(excitations), squeeze=False).T, excitations, strict=True):
            _draw(axes, excitation)
        metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix, {})
        figure.savefig(path, metadata=metadata, dpi=150)


def _draw(axes: Any, excitation: ExcitationTrajectory) -> None:
    t = np.linspace(0.0, excitation.series.period, 1001)
    unit = excitation.joint.unit("{position}")
    labels = (f"position [{unit}]", f"velocity [{unit}/s]", f"acceleration [{unit}/s²]")
    motion = fourier.motion(excitation.series, t)
    for ax, values, limits, label in zip(axes, motion, excitation.problem.limits, labels, strict=True):
        ax.plot(t, values, color="#0072b2")
        for limit in limits:
            ax.axhline(limit, color="#d55e00", linestyle="--", linewidth=1.0)
        ax.set(ylabel=label, xlim=(0.0, t[-1]))
        ax.grid(alpha=0.3)
    axes[0].set_title(f"{excitation.joint.title}: objective {excitation.objective:.4f}", fontsize=10)
    axes[-1].set_xlabel("t [s]; dashed: the limits")


def table(
    excitations: Sequence[ExcitationTrajectory], rate: float, from_rest: bool = True, limits: ArmLimits | None = None
) -> str:
    """Write the run-in from rest and one period at the controller's rate [Hz]: t, q, dq, ddq, with SI units.

    The period starts at t = 0, and the run-in has negative times; if `from_rest` is False, there is no run-in.  The
    run-in keeps the `limits` of the arm.  Raises BadRequest if the periods differ, a period is no whole number of
    samples, or no run-in keeps the limits.
    """
    samples = _samples(excitations, rate)
    before = _run_in_samples(excitations, samples, rate, limits) if from_rest else 0
    t = np.arange(-before, samples) / rate
    prefixes = [f"{e.joint.name}." if len(excitations) > 1 else "" for e in excitations]
    header = ",".join(["t", *(f"{p}{symbol}" for p in prefixes for symbol in ("q", "dq", "ddq"))])
    text = io.StringIO()
    columns = np.column_stack([t, *(column for e in excitations for column in _with_run_in(e.series, t, before))])
    np.savetxt(text, columns, "%.12g", delimiter=",", header=header, comments="", newline="\n")
    return text.getvalue()


def _samples(excitations: Sequence[ExcitationTrajectory], rate: float) -> int:
    """The number of samples in one period."""
    if not (math.isfinite(rate) and rate > 0):
        raise BadRequest(f"--rate must be positive, not {rate:g}")
    if problem := unlikely("--rate", rate, "rate"):
        raise BadRequest(f"{problem}, not {rate:g}")
    period = excitations[0].series.period
    samples = round(period * rate)
    if any(e.series.period != period for e in excitations):
        raise BadRequest("joints that move together need the same period; set it with --period")
    if abs(period * rate - samples) > 1e-9 * samples or samples < 1:
        raise BadRequest(
            f"a period of {period:g} s is {period * rate:g} samples at {rate:g} Hz; choose a period or a rate that "
            "gives a whole number, so that the trajectory repeats exactly"
        )
    return samples


def _run_in_samples(
    excitations: Sequence[ExcitationTrajectory], samples: int, rate: float, limits: ArmLimits | None
) -> int:
    """The number of samples in the shortest run-in that keeps the limits."""
    durations = np.unique(np.linspace(samples / 4, samples, RUN_INS).round().clip(1)) / rate
    accelerations = [e.problem.limits[2] for e in excitations]
    hold = limits.hold if limits else None
    if duration := fourier.shortest_run_in([e.series for e in excitations], accelerations, durations, hold):
        return round(duration * rate)
    raise BadRequest(
        "no run-in of at most one period keeps the limits of acceleration, effort and workspace; write the period "
        "alone, with --no-run-in, and move to its start by other means"
    )


def _with_run_in(series: fourier.Fourier, t: Array, before: int) -> Array:
    """Position, velocity and acceleration (3, K) at t; the first `before` samples are the run-in."""
    moving = np.array(fourier.motion(series, t[before:]))
    return np.hstack([fourier.run_in(series, t[:before], -t[0]), moving]) if before else moving
